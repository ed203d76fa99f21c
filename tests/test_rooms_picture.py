"""The map of rooms in CONTRIBUTING.md shows the rooms that there are, and the imports that are allowed."""

import re
from pathlib import Path
from xml.etree import ElementTree

from tests.test_architecture import MAY_IMPORT, PACKAGE
from tools import rooms_picture

CONTRIBUTING = (Path(__file__).resolve().parents[1] / "CONTRIBUTING.md").read_text(encoding="utf8")


def test_the_picture_is_what_the_tool_draws() -> None:
    assert rooms_picture.TARGET.read_text(encoding="utf8") == rooms_picture.picture(MAY_IMPORT)


def test_every_room_is_in_it() -> None:
    rooms = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert rooms == MAY_IMPORT.keys() == rooms_picture.PLACES.keys()
    root = ElementTree.fromstring(rooms_picture.picture(MAY_IMPORT))
    names = {each.text for each in root.iter() if each.get("class") == "name"}
    assert names == rooms


def test_its_arrows_imply_what_is_allowed_and_no_more() -> None:
    reached = {room: set() for room in MAY_IMPORT}
    arrows = rooms_picture.drawn(MAY_IMPORT)
    for _ in MAY_IMPORT:
        for room, other in arrows:
            reached[room] |= {other} | reached[other]
    assert reached == MAY_IMPORT


def test_the_page_shows_it_and_says_it_in_words() -> None:
    (alt,) = re.findall(r"!\[([^\]]+)\]\(book/_static/rooms\.svg\)", CONTRIBUTING)
    assert len(alt) > 20
    for room, other in rooms_picture.drawn(MAY_IMPORT):
        assert re.search(rf"`{room}`[^·\n]*→[^·\n]*`{other}`", CONTRIBUTING), (room, other)
