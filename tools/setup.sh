#!/usr/bin/env bash
# Creates .venv and installs the book from its pins. Safe to run again: it does nothing when all is in place, and
# repairs what an interrupted run left behind. Called by every `make` target that needs it.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf '\033[1m%s\033[0m\n' "$*"; }
fail() { printf 'set-up stopped: %s\n' "$*" >&2; exit 1; }

find_python() {
  local candidate
  for candidate in ${PYTHON:-} python3.13 python3.12 python3.11 python3; do
    if command -v "$candidate" >/dev/null && "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      command -v "$candidate"
      return
    fi
  done
  fail "no Python 3.11 or newer found. Install it (Debian/Ubuntu: apt install python3 python3-venv) or name one: make PYTHON=/path/to/python3.12"
}

# True when MuJoCo's off-screen renderer has an OpenGL to load.
opengl_is_there() {
  [ "$(uname -s)" != Linux ] || "$1" -c '
import ctypes, ctypes.util, sys
def there(name):
    try:
        return bool(ctypes.CDLL(ctypes.util.find_library(name) or f"lib{name}.so.1"))
    except OSError:
        return False
sys.exit(not (there("EGL") and (there("OpenGL") or there("GL")) or there("OSMesa")))'
}

install_system_packages() {
  local python=$1; shift
  local missing=() package as_root=()
  command -v dpkg-query >/dev/null || {
    opengl_is_there "$python" || fail "OpenGL for off-screen rendering is missing: install Mesa's EGL and libOpenGL (on Debian the packages are: $(xargs < apt.txt))"
    return 0
  }
  for package in "$@"; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
  done
  [ ${#missing[@]} -gt 0 ] || return 0
  if [ "$(id -u)" != 0 ]; then
    if command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
      as_root=(sudo -n)
    else
      fail "system packages are missing: run  sudo apt-get install ${missing[*]}  and try again"
    fi
  fi
  say "Installing system packages: ${missing[*]}"
  { "${as_root[@]}" apt-get update -q && "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
      apt-get install -y -q --no-install-recommends "${missing[@]}"; } >.venv/apt.log 2>&1 ||
    { tail -n 5 .venv/apt.log >&2; fail "apt-get could not install ${missing[*]} (network? see .venv/apt.log)"; }
}

on_path() {
  local name
  for name in "$@"; do
    [ -z "$name" ] || ! command -v "$name" >/dev/null || return 0
  done
  return 1
}

# What `--with-chromium` and `--with-browsers` ask for, by the names that tests/pages looks for, too.
install_browsers() {
  case "$1" in --with-chromium | --with-browsers)
    on_path "${INBOUNDS_CHROMIUM:-}" chromium chromium-browser google-chrome google-chrome-stable chrome ||
      install_system_packages .venv/bin/python chromium
    install_system_packages .venv/bin/python libatomic1 ;;  # for the node that Playwright brings
  esac
  case "$1" in --with-browsers)
    on_path "${INBOUNDS_FIREFOX:-}" firefox-esr firefox || install_system_packages .venv/bin/python firefox-esr ;;
  esac
}

# What the stamp must say for the environment to be up to date.
fingerprint() { { cat pyproject.toml constraints.txt apt.txt tools/setup.sh; .venv/bin/python -VV; pwd; } | cksum; }

stamp=.venv/.complete
if [ -x .venv/bin/python ] && [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$(fingerprint 2>/dev/null)" ]; then
  install_browsers "${1:-}"
  exit 0
fi

[ ! -L .venv ] || fail ".venv is a link: setting up here would empty the environment it points to. Remove the link (rm .venv), and run the same command again"

free_kb=$(df -Pk . | awk 'NR==2 {print $4}')
[ "$free_kb" -gt 4000000 ] || fail "the environment and the book need about 4 GB of disk, $((free_kb / 1000000)) GB are free here: make room, or clone to another disk"
[ "$free_kb" -gt 8000000 ] || say "Only $((free_kb / 1000000)) GB of disk are free: enough for PyTorch's CPU build (INSTALL.md says how to ask for it), not for the one with CUDA"

# A folder that was moved or copied brings commands that call the Python of the old place: start anew.
at_home() { head -n 1 .venv/bin/pip 2>/dev/null | grep -qF "$PWD/.venv/"; }
if ! at_home || ! .venv/bin/python -c 'import pip, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
  python=$(find_python)
  say "Creating .venv with $("$python" -V)"
  "$python" -m venv --clear .venv 2>/dev/null ||
    fail "this Python cannot create a virtual environment. On Debian/Ubuntu: apt install python3-venv"
fi
rm -f "$stamp"
# shellcheck disable=SC2046
install_system_packages .venv/bin/python $(xargs < apt.txt)
say "Installing the pinned packages (the first time a few minutes to a quarter of an hour, a gigabyte or more to download)"
.venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[book,lab,test]' ||
  fail "pip could not install the packages. Check the network (or the proxy and index settings of pip), then run the same command again: it goes on where it stopped"
.venv/bin/python -m pip check --disable-pip-version-check >/dev/null || fail "the installed packages contradict each other: run  make distclean  and try again"
fingerprint > "$stamp"
install_browsers "${1:-}"
say "The environment is ready (.venv)"
