"""Screenshots of the built book, light and dark, at desktop and phone width.

python -m tests.pages.screenshots FOLDER [PAGE ...]     e.g. book/preface.html; without a page, all of them
"""

import sys
from pathlib import Path

from tests.pages import browser as book

PATIENCE = 300_000  # milliseconds: a chapter's picture is tall, and the machine may be busy
LOOKS = {
    "light": (book.DESKTOP, "light"),
    "dark": (book.DESKTOP, "dark"),
    "phone": (book.PHONE, "light"),
    "phone-dark": (book.PHONE, "dark"),
}


def main(folder: Path, names: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with book.served(book.HTML) as address, book.chromium() as browser:
        for look, (viewport, theme) in LOOKS.items():
            context = browser.new_context(viewport=viewport)
            context.set_default_timeout(PATIENCE)
            context.add_init_script(book.choose_theme(theme))
            for name in names or book.pages():
                page = context.new_page()
                page.goto(address + name, wait_until="networkidle")
                page.evaluate(book.AT_REST)
                path = folder / f"{name.removesuffix('.html').replace('/', '-')}-{look}.png"
                page.screenshot(path=path, full_page=True)
                page.close()
                print(path, flush=True)
            context.close()


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), sys.argv[2:])
