"""What a reader types into the search finds its page first, with a passage, over a server and from the disk."""

import pytest
from playwright.sync_api import BrowserContext, Page

from tests.pages import browser as book
from tests.pages.test_accessibility import AXE, serious

QUERIES = {
    "which policy": "which_policy",
    "install": "preface",
    "KL invariance": "kl_invariance",
    "entropy bonus": "kl_invariance",
    "SAC": "tanh_gaussian",
    "tanh": "tanh_gaussian",
    "SB3": "other_libraries",
    "TorchRL": "other_libraries",
    "confidence interval": "how_to_compare_ten_seeds",
    "p-value": "how_to_compare_ten_seeds",
    "mode of the logit-normal": "logit_normal_moments",
    "natural gradient": "trpo",
    "trust region": "trpo",
    "GAE": "advantages_of_actions",
    "reward to go": "policy_that_learns",
    "bfloat16": "storing_actions",
    "saturation": "boundary_effect",
    "discretisation": "grids",
    "deterministic evaluation": "greedy_action",
    "custom environment": "your_own_environment",
    "symbols": "notation",
    "how to cite": "front_page",
}


def ask(page: Page, start: str, query: str) -> None:
    """Search, and wait for the answer."""
    page.goto(f"{start}search.html?q={query.replace(' ', '+')}")
    page.wait_for_selector("#search-results .search-summary:not(:empty)")


@pytest.mark.parametrize("query", QUERIES)
def test_the_right_page_is_first(page: Page, address: str, query: str) -> None:
    ask(page, address, query)
    first = page.locator("#search-results li a").first
    assert (first.get_attribute("href") or "").rpartition("/")[2] == f"{QUERIES[query]}.html"


@pytest.mark.parametrize("scheme", ["http", "file"])
def test_results_have_passages_and_lead_there(context: BrowserContext, address: str, scheme: str) -> None:
    page = context.new_page()
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    ask(page, address if scheme == "http" else f"{book.HTML.as_uri()}/", "KL invariance")
    assert len(page.locator("#search-results li .context").first.inner_text()) > 40
    page.locator("#search-results li a").first.click()
    assert "kl_invariance" in page.url
    assert "KL invariance" in page.locator("article h1").inner_text()
    assert complaints == []


def test_names_of_the_package_are_found(page: Page, address: str) -> None:
    ask(page, address, "inbounds.learning.train")
    assert (page.locator("#search-results li a").first.get_attribute("href") or "").startswith(
        "book/api.html#"
    )


def test_nothing_found_is_said(page: Page, address: str) -> None:
    ask(page, address, "zeppelin")
    assert "Nothing in the book" in page.locator(".search-summary").inner_text()
    assert page.locator("#search-results li").count() == 0


def test_results_are_accessible(page: Page, address: str) -> None:
    page.set_viewport_size(book.PHONE)
    ask(page, address, "policy")
    assert page.locator("#search-results li").count() > 1
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    page.evaluate(AXE)
    assert serious(page, "light") == []
    assert serious(page, "dark") == []
