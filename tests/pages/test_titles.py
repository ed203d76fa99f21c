"""Links in the titles of folds are followed, and tables are told apart by their names."""

import pytest
from playwright.sync_api import Page

TABLES = """[...document.querySelectorAll('article table')]
  .filter((table) => !table.closest('.inbounds-explorable') && !table.caption && table.checkVisibility())"""


def test_a_link_in_a_solutions_title_leads_to_its_exercise_and_opens_nothing(
    page: Page, address: str
) -> None:
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(f"{address}notebooks/ppo.html", wait_until="networkidle")
    solutions = page.locator(".solution.toggle")
    assert solutions.count() > 1
    solutions.nth(0).locator(".toggle-button").click()
    before = solutions.evaluate_all("nodes => nodes.map((node) => node.className)")
    link = solutions.nth(1).locator(".admonition-title a")
    target = link.get_attribute("href")
    link.click()
    assert target is not None
    assert page.url.endswith(target[target.index("#") :])
    assert solutions.evaluate_all("nodes => nodes.map((node) => node.className)") == before
    assert errors == []


@pytest.mark.parametrize("name", ["ppo", "kl_invariance", "trpo"])
def test_the_button_of_a_fold_is_called_what_it_folds(page: Page, address: str, name: str) -> None:
    page.goto(f"{address}notebooks/{name}.html", wait_until="load")
    folds = page.locator(".admonition.toggle")
    names = [button.get_attribute("aria-label") for button in folds.locator(".toggle-button").all()]
    assert names == [title.strip() for title in folds.locator("> .admonition-title").all_inner_texts()]
    assert len(set(names)) == len(names) > 1


@pytest.mark.parametrize("name", ["ppo", "boundary_effect", "what_happened", "all_tables"])
def test_tables_without_a_caption_are_called_by_their_section_and_no_two_alike(
    page: Page, address: str, name: str
) -> None:
    page.goto(f"{address}notebooks/{name}.html", wait_until="networkidle")
    page.wait_for_function(f"{TABLES}.every((table) => table.ariaLabel)")
    names = page.evaluate(f"{TABLES}.map((table) => table.ariaLabel)")
    assert all(any(letter.isalpha() for letter in each.removeprefix("Table: ")) for each in names)
    assert len(set(names)) == len(names)
