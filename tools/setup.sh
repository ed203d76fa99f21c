#!/usr/bin/env bash
# Creates .venv and installs the book from its pins. Safe to run again: it does nothing when all is in place, and
# repairs what an interrupted run left behind. Called by every `make` target that needs it.
set -euo pipefail
cd -P "$(dirname "$0")/.."  # a link to this folder is no other place

say() { printf '\033[1m%s\033[0m\n' "$*"; }
fail() { printf 'set-up stopped: %s\n' "$*" >&2; exit 1; }

version_of() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])'; }
supported() { case "$1" in 3.11 | 3.12 | 3.13) ;; *) return 1 ;; esac; }

# The Python that is named, or the newest of those that the tests run on.
find_python() {
  local candidate version bare='' other='' candidates=(python3.13 python3.12 python3.11 python3)
  if [ -n "${PYTHON:-}" ]; then
    candidates=("$PYTHON")
    version_of "$PYTHON" >/dev/null || fail "there is no Python that runs by the name of $PYTHON, which PYTHON gives"
  fi
  for candidate in "${candidates[@]}"; do
    version=$(version_of "$candidate" 2>/dev/null) || continue
    if ! supported "$version"; then
      other=$version
    elif ! "$candidate" -c 'import ensurepip, venv' 2>/dev/null; then
      bare=${bare:-$version}
    else
      command -v "$candidate"
      return
    fi
  done
  [ -z "$bare" ] || fail "Python $bare is here without what creates a virtual environment. On Debian/Ubuntu: apt install python$bare-venv"
  [ -z "$other" ] || fail "Python 3.11, 3.12 or 3.13 is needed, ${PYTHON:-python3} is $other. Name one of them: make PYTHON=/path/to/python3.12"
  fail "no Python 3.11, 3.12 or 3.13 found. Install one (Debian/Ubuntu: apt install python3 python3-venv) or name it: make PYTHON=/path/to/python3.12"
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

# What the stamp must say for the environment to be up to date. Of pyproject.toml only what pip reads: the rest sets up
# the tools of who writes the book.
fingerprint() {
  { .venv/bin/python -c '
import sys, tomllib
with open("pyproject.toml", "rb") as file:
    project = tomllib.load(file)
print(sys.version, project["build-system"], project["project"], project.get("tool", {}).get("hatch"))'
    cat constraints.txt apt.txt tools/setup.sh; pwd; } | cksum
}

stamp=.venv/.complete
up_to_date() { [ -x .venv/bin/python ] && [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$(fingerprint 2>/dev/null)" ]; }
if up_to_date; then
  install_browsers "${1:-}"
  exit 0
fi

[ ! -L .venv ] || fail ".venv is a link: setting up here would empty the environment it points to. Remove the link (rm .venv), and run the same command again"

# A folder that was moved or copied brings commands that call the Python of the old place: start anew. Where the path
# has a space, pip's first line names a shell, and the second this place.
at_home() { head -n 2 .venv/bin/pip 2>/dev/null | grep -qF -e "#!$PWD/.venv/" -e "\"$PWD/.venv/"; }
sound() { at_home && supported "$(version_of .venv/bin/python 2>/dev/null)" && .venv/bin/python -c 'import pip' 2>/dev/null; }

# One set-up at a time. The lock is on a file that this process has open: its end lets go of it, however it comes.
python=.venv/bin/python
sound || python=$(find_python)
mkdir -p .cache
exec 9>.cache/setup.lock
lock() { "$python" -c "from fcntl import *; flock(9, $1)" 2>/dev/null; }
lock 'LOCK_EX | LOCK_NB' || {
  say "Another command sets up .venv here: waiting for it"
  lock LOCK_EX || say "This disk has no locks: going on"
}
if up_to_date; then
  install_browsers "${1:-}"
  exit 0
fi

if ! sound; then
  python=$(find_python)
  free_kb=$(df -Pk . | awk 'NR==2 {print $4}')
  [ "$free_kb" -gt 4000000 ] || fail "the environment and the book need about 4 GB of disk, $((free_kb / 1000000)) GB are free here: make room, or clone to another disk"
  [ "$free_kb" -gt 8000000 ] || say "Only $((free_kb / 1000000)) GB of disk are free: enough for PyTorch's CPU build (INSTALL.md says how to ask for it), not for the one with CUDA"
  say "Creating .venv with $("$python" -V)"
  said=$("$python" -m venv --clear .venv 2>&1) ||
    { tail -n 5 <<< "$said" >&2; fail "$python could not create a virtual environment, as it says above"; }
fi
rm -f "$stamp"
# shellcheck disable=SC2046
install_system_packages .venv/bin/python $(xargs < apt.txt)
say "Installing the pinned packages (the first time a few minutes to a quarter of an hour, a gigabyte or more to download)"
.venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[book,lab,test]' ||
  fail "pip could not install the packages. Check the network (or the proxy and index settings of pip), then run the same command again: it goes on where it stopped"
said=$(.venv/bin/python -m pip check --disable-pip-version-check 2>&1) ||
  { tail -n 5 <<< "$said" >&2; fail "the installed packages contradict each other: run  make distclean  and try again"; }
fingerprint > "$stamp"
install_browsers "${1:-}"
say "The environment is ready (.venv)"
