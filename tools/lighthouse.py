"""How fast pages come to a phone, by Lighthouse: the medians of some runs, and whether they reach the bar.

    python tools/lighthouse.py                       six pages, three runs each  (needs `make book`; some minutes)
    python tools/lighthouse.py notebooks/ppo.html    these alone

Lighthouse loads a page in headless Chromium and works out what a phone with a quarter of this processor, on a slow
mobile network, would have needed. Other work on this machine lowers the score: let it rest. INBOUNDS_CHROMIUM names
the browser (default: Chromium or Chrome on PATH). npm brings Lighthouse, once.
"""

import argparse
import json
import statistics
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from inbounds.book.npm import CACHE, NpmError, made_once, node

ROOT = Path(__file__).resolve().parents[1]
HTML = ROOT / "_build" / "html"
HERE = Path(__file__).with_suffix("")
BAR = 70  # of a hundred
PAGES = (
    "notebooks/front_page.html",
    "notebooks/which_policy.html",
    "notebooks/ppo.html",
    "notebooks/how_to_compare_ten_seeds.html",
    "notebooks/what_happened.html",
    "notebooks/live_robot.html",
)
COLUMNS = {"score": "score", "seen": "seen [s]", "largest": "largest [s]", "blocked": "blocked [s]"} | {
    "shift": "shift",
    "kilobytes": "kB",
}


def installed(folder: Path, made: Path) -> None:
    """Keep what the script needs."""
    for name in ("node_modules", "measure.mjs"):
        (folder / name).rename(made / name)


def measure(browser: str, html: Path, runs: int, pages: list[str]) -> dict[str, dict[str, float]]:
    """Return the medians of each page, and print a dot a run."""
    inputs = [HERE / name for name in ("package.json", "package-lock.json", "measure.mjs")]
    script = made_once(CACHE / "lighthouse", inputs, installed) / "measure.mjs"
    command = [str(node()), str(script), browser, str(html), str(runs), *pages]
    found: defaultdict[str, list[dict[str, float]]] = defaultdict(list)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            run = json.loads(line)
            found[run.pop("page")].append(run)
            print(".", end="", flush=True)
    print()
    if process.returncode:
        raise RuntimeError("Lighthouse stopped; what it said is above")
    return {
        page: {key: statistics.median(run[key] for run in each) for key in COLUMNS}
        for page, each in found.items()
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pages", nargs="*", default=PAGES, metavar="PAGE", help="as below --html")
    parser.add_argument("--runs", type=int, default=3, help="of each page (3)")
    parser.add_argument("--html", type=Path, default=HTML, help="folder of the built book (_build/html)")
    args = parser.parse_args()
    if missing := [page for page in args.pages if not (args.html / page).is_file()]:
        print(f"no page {missing[0]} in {args.html}: run `make book` first", file=sys.stderr)
        return 1
    sys.path.insert(0, str(ROOT))
    from tests.pages.browser import STEADY, find_chromium  # as in the page tests

    try:
        found = measure(find_chromium(), args.html.resolve(), args.runs, list(args.pages))
    except (NpmError, RuntimeError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{'':42}" + "".join(f"{head:>12}" for head in COLUMNS.values()))
    for page, row in found.items():
        numbers = (f"{row[key]:.3g}" if row[key] < 1000 else f"{row[key]:.0f}" for key in COLUMNS)
        print(f"{page:42}" + "".join(f"{number:>12}" for number in numbers))
    low = [page for page, row in found.items() if row["score"] < BAR or row["shift"] > STEADY]
    print(f"below {BAR}, or moves more than {STEADY}: {', '.join(low)}" if low else f"All reach {BAR}.")
    return 1 if low else 0


if __name__ == "__main__":
    sys.exit(main())
