"""The folder that the built book serves as `_static/live`: scripts, policies, licences, or why there are only films.

python -m inbounds.book.live.site FOLDER
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from importlib import metadata
from pathlib import Path

from inbounds.book.live import export
from inbounds.book.live.packages import JS, bundle
from inbounds.book.npm import NpmError

NUMERICS = Path(__file__).parents[1] / "explorables" / "numerics.js"
LARGEST = 20_000_000  # bytes of all policies together


def scripts(*, drawn: bool = True) -> list[Path]:
    """Return the scripts that a page runs, in this order, after those that `packages` makes and the catalogue.

    Args:
        drawn: with those that draw, which need a page.

    Example:
        >>> [path.name for path in scripts(drawn=False)]
        ['numerics.js', 'laws.js', 'policy.js', 'noise.js', 'world.js', 'player.js', 'densities.js']
    """
    names = ["laws", "policy", "noise", "world", "player", "densities"]
    names += ["scene", "dom", "panel", "show"] if drawn else []
    return [NUMERICS, *(JS / f"{name}.js" for name in names)]


def write(target: Path) -> str:
    """Write the folder anew.

    Args:
        target: the folder; what was in it goes.

    Returns:
        An empty text, or why the robots cannot run in this copy of the book: then the page has films alone.

    Raises:
        ValueError: the policies take more than 20 MB.
    """
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    shutil.copy2(JS / "boot.js", target / "boot.js")
    try:
        made = bundle()
    except NpmError as error:
        _say(
            target,
            why="The robots do not run in this copy of the book: it was built where npm could not be reached.",
        )
        return str(error)
    for path in (*scripts(), *made.iterdir()):
        shutil.copy2(path, target / path.name)
    with (target / "licences.txt").open("a", encoding="utf8") as file:
        file.write(
            licence_of("mujoco") + licence_of("gymnasium")
        )  # of the build in npm, and of the robots' models
    if (total := export.write(target)) > LARGEST:
        raise ValueError(f"the policies take {total / 1e6:.1f} MB, more than {LARGEST / 1e6:.0f} MB")
    loaded = sum((target / path.name).stat().st_size for path in (*scripts(), *made.glob("*.js")))
    parts = ["engine.js", "wasm.js", "three.js", "catalogue.js", *(path.name for path in scripts())]
    _say(target, size=f"This loads {loaded / 1e6:.1f} MB, once, from this book.", parts=parts)
    return ""


def _say(target: Path, **status: str | list[str]) -> None:
    (target / "status.js").write_text(
        "globalThis.inbounds ??= {};\ninbounds.live ??= {};\n"
        f"inbounds.live.status = {json.dumps(status, ensure_ascii=False)};\n",
        encoding="utf8",
    )


def licence_of(package: str) -> str:
    """Return the licences that an installed Python package brings.

    Example:
        >>> "MIT" in licence_of("gymnasium"), "Apache" in licence_of("mujoco")
        (True, True)
    """
    found = metadata.distribution(package)
    files = [file for file in found.files or [] if file.name.upper().startswith("LICENSE")]
    texts = [Path(str(file.locate())).read_text(encoding="utf8") for file in files]
    return "\n".join([f"\n{package} {found.version}\n", *texts])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description="Write the live robot's scripts, robots and policies into a folder."
    )
    parser.add_argument("folder", type=Path, help="made where it is missing; what it held is replaced")
    folder = parser.parse_args().folder
    if folder.exists() and any(folder.iterdir()) and not (folder / "status.js").is_file():
        sys.exit(f"{folder} has something else in it, which would be deleted: name a new folder")
    if why := write(folder):
        print(f"The live robot: films only. {why}")
