"""What a screen reader would say, by Chromium's accessibility tree: names for what can be used, and no icon's code."""

from typing import Any

import pytest
from playwright.sync_api import Page

USED = {
    "button",
    "link",
    "slider",
    "textbox",
    "combobox",
    "checkbox",
    "radio",
    "spinbutton",
    "DisclosureTriangle",
}
SHOWN = {"image", "img", "table"}  # a figure is told by what is in it: a picture with a name, and a caption
ICONS = range(0xE000, 0xF900)  # where icon fonts keep their pictures


def spoken(page: Page, url: str) -> list[tuple[str, str, dict[str, Any]]]:
    """Role, name and properties of what a page tells, in its order."""
    page.goto(url)
    page.wait_for_load_state("load")
    page.wait_for_timeout(500)
    nodes = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
    return [
        (
            node["role"]["value"],
            node.get("name", {}).get("value", ""),
            {each["name"]: each["value"].get("value") for each in node.get("properties", [])},
        )
        for node in nodes
        if not node.get("ignored")
    ]


@pytest.mark.parametrize(
    "name",
    [
        "notebooks/front_page.html",
        "notebooks/greedy_action.html",
        "notebooks/ppo.html",
        "notebooks/live_robot.html",
    ],
)
def test_what_is_used_or_shown_has_a_name_in_words(page: Page, address: str, name: str) -> None:
    told = spoken(page, address + name)
    assert len(told) > 100
    nameless = [role for role, name, _ in told if role in USED | SHOWN and not name.strip()]
    assert nameless == []
    drawn = [
        name for role, name, _ in told if role in USED and any(ord(c) in ICONS or c in "▸▾" for c in name)
    ]
    assert drawn == []
    assert [properties for _, _, properties in told if properties.get("live") == "assertive"] == []


def test_a_formula_is_read_part_by_part(page: Page, address: str) -> None:
    roles = [role for role, _, _ in spoken(page, address + "notebooks/greedy_action.html")]
    assert roles.count("MathMLMath") > 50
    assert roles.count("MathMLIdentifier") > roles.count("MathMLMath")


def test_a_guess_is_a_group_with_its_question_as_name(page: Page, address: str) -> None:
    told = spoken(page, address + "notebooks/greedy_action.html")
    assert [name for role, name, _ in told if role == "group" and name.startswith("1. ")]
    assert {properties["live"] for role, _, properties in told if role == "status"} == {"polite"}
