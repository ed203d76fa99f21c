"""Predict boxes take a guess, score it in words, remember it from page to page, and forget it when told to."""

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from tests.pages import browser as book

PAGES = book.pages('class="inbounds-guess"')
CHOICES = [name for name in PAGES if 'data-kind="choice"' in (book.HTML / name).read_text(encoding="utf8")]
NUMBERS = [name for name in PAGES if 'data-kind="number"' in (book.HTML / name).read_text(encoding="utf8")]
# Fills in every question of the page's first box, each right or each wrong.
ANSWER = """right => {
  const guesses = [...document.querySelectorAll('.predict .inbounds-guess')];
  for (const guess of guesses) {
    const { kind, right: key, truth, within } = guess.dataset;
    if (kind === 'number') {
      const far = within.startsWith('x') ? truth * within.slice(1) ** 3 : Number(truth) + 3 * within;
      guess.querySelector('input[type=text]').value = right ? truth : far;
    } else for (const input of guess.querySelectorAll('input')) {
      if (key.includes(input.value) === right) input.click();
    }
  }
  return guesses.length;
}"""


def answered(page: Page, *, right: bool) -> int:
    """Answer the page's box, and check; how many questions that were."""
    count: int = page.evaluate(ANSWER, right)
    check = page.locator(".guess-check").first
    check.focus()
    page.keyboard.press("Enter")
    return count


def test_the_core_chapters_ask() -> None:
    assert len(PAGES) >= 18


@pytest.mark.parametrize("scheme", ["http", "file"])
def test_guesses_are_scored_and_remembered(page: Page, address: str, scheme: str) -> None:
    start = address if scheme == "http" else f"{book.HTML.as_uri()}/"
    page.goto(start + CHOICES[0])
    first = answered(page, right=True)
    results = page.locator(".guess-result")
    assert all(text.startswith("Right") for text in results.all_inner_texts())
    assert page.locator(".predict details").get_attribute("open") is not None
    assert f"right in {first} of {first} guesses" in page.locator(".guess-tally").inner_text()
    page.goto(start + CHOICES[1])
    assert page.locator(".guess-tally").inner_text() == ""
    second = answered(page, right=False)
    told = page.locator(".guess-result").all_inner_texts()
    assert all(text.startswith(("Not so", "Off")) for text in told)
    assert f"right in {first} of {first + second} guesses" in page.locator(".guess-tally").inner_text()
    page.reload()
    assert page.locator(".guess-result").all_inner_texts() == told
    assert page.locator(".inbounds-guess input:enabled").count() == 0
    page.get_by_role("button", name="Forget all my guesses").click()
    assert page.locator(".guess-tally").inner_text().startswith("Forgotten.")
    assert all(text == "" for text in page.locator(".guess-result").all_inner_texts())
    page.get_by_role("button", name="Bring them back").click()
    assert page.locator(".guess-result").all_inner_texts() == told
    page.reload()
    assert page.locator(".guess-result").all_inner_texts() == told
    page.get_by_role("button", name="Forget all my guesses").click()
    page.reload()
    assert all(text == "" for text in page.locator(".guess-result").all_inner_texts())
    page.goto(start + CHOICES[0])
    assert all(text == "" for text in page.locator(".guess-result").all_inner_texts())


@pytest.mark.parametrize("name", PAGES)
def test_every_box_can_be_answered_right_and_wrong(page: Page, address: str, name: str) -> None:
    page.goto(address + name)
    page.locator(".guess-check").first.click()
    assert "No guess yet." in page.locator(".guess-result").all_inner_texts()
    answered(page, right=True)
    assert all(text.startswith("Right") for text in page.locator(".guess-result").all_inner_texts())
    page.locator(".guess-check").first.click()  # again
    answered(page, right=False)
    assert all(text.startswith(("Not so", "Off")) for text in page.locator(".guess-result").all_inner_texts())


def test_a_double_click_checks_once(page: Page, address: str) -> None:
    page.goto(address + CHOICES[0])
    page.evaluate(ANSWER, True)
    page.locator(".guess-check").first.dblclick()
    assert all(text.startswith("Right") for text in page.locator(".guess-result").all_inner_texts())


def test_a_box_that_another_page_has_checked_since_is_checked(context: BrowserContext, address: str) -> None:
    first, second = (context.new_page() for _ in range(2))
    for page in (first, second):
        page.goto(address + CHOICES[0])
    answered(first, right=True)
    second.locator(".guess-check").first.click()
    assert "No guess yet." in second.locator(".guess-result").all_inner_texts()
    answered(second, right=False)
    assert all(
        text.startswith(("Not so", "Off")) for text in second.locator(".guess-result").all_inner_texts()
    )


def test_who_answers_by_the_keyboard_stays_at_the_box(page: Page, address: str) -> None:
    page.goto(address + NUMBERS[0])
    page.evaluate(ANSWER, True)
    page.locator(".inbounds-guess input[type=text]").first.press("Enter")
    assert page.evaluate("document.activeElement.textContent") == "Guess again"


@pytest.mark.parametrize(
    ("typed", "understood"),
    [
        ("0.4", "0.4"),
        ("0,4", "0.4"),
        (" 12 % ", "12"),
        ("−3", "−3"),
        ("3,000", "3000"),
        ("1,234,567.5", "1234567.5"),
        ("1,2345", "1.2345"),
    ],
)
def test_a_number_may_be_typed_as_people_type_it(
    page: Page, address: str, typed: str, understood: str
) -> None:
    page.goto(address + NUMBERS[0])
    page.evaluate(ANSWER, True)
    first = page.locator(".inbounds-guess[data-kind=number]").first
    first.locator("input[type=text]").fill(typed)
    first.locator("input[type=text]").press("Enter")
    said = first.locator(".guess-result").inner_text()
    assert f": you said {understood}" in said
    assert said.split(f"you said {understood}")[1][0] in ",\u202f"


def test_what_is_no_number_is_no_guess(page: Page, address: str) -> None:
    page.goto(address + NUMBERS[0])
    page.evaluate(ANSWER, True)
    field = page.locator(".inbounds-guess input[type=text]").first
    field.fill("a lot")
    field.press("Enter")
    assert "Not a number: a lot" in page.locator(".guess-result").all_inner_texts()
    assert page.locator(".predict details").first.get_attribute("open") is None


def test_copying_the_page_leaves_a_choice_as_it_is(page: Page, address: str) -> None:
    page.goto(address + CHOICES[0])
    choice = page.locator(".predict input[type=radio]").first
    choice.check()
    copied = page.evaluate(
        """() => {
      const copy = new ClipboardEvent('copy', { clipboardData: new DataTransfer(), bubbles: true, cancelable: true });
      getSelection().selectAllChildren(document.querySelector('article'));
      document.dispatchEvent(copy);
      return copy.clipboardData.getData('text/plain');
    }"""
    )
    assert "$" in copied
    assert choice.is_checked()


def test_a_wrong_choice_is_told_why(page: Page, address: str) -> None:
    page.goto(address + next(name for name in CHOICES if "boundary_effect" in name))
    answered(page, right=False)
    told = page.locator(".guess-result").first
    assert "right is (b)" in told.inner_text()
    assert len(told.inner_text()) > len(told.locator("strong").inner_text()) + 20


def test_a_kept_guess_is_scored_by_the_truth_of_today(page: Page, address: str) -> None:
    """Numbers of the study change as cells arrive; what is garbled is no guess, and keeps no box from working."""
    page.goto(address + NUMBERS[0])
    count = answered(page, right=True)
    page.evaluate("""() => {
      const kept = JSON.parse(localStorage.getItem('inbounds-guesses'));
      const numbers = Object.values(kept).filter((one) => !Number.isNaN(Number(one.guess)));
      for (const one of numbers) one.guess = String(Number(one.guess) * 1000 + 1e6);
      localStorage.setItem('inbounds-guesses', JSON.stringify({ ...kept, 'p-of-old': null, another: 7 }));
    }""")
    page.reload()
    numbers = page.locator(".inbounds-guess[data-kind=number] .guess-result")
    assert all(text.startswith("Off: you said") for text in numbers.all_inner_texts())
    assert f"of {count} guesses" in page.locator(".guess-tally").first.inner_text()


def test_a_browser_that_keeps_nothing_still_scores(context: BrowserContext, address: str) -> None:
    page = context.new_page()
    failed: list[str] = []
    page.on("pageerror", lambda error: failed.append(str(error)))
    page.add_init_script("Object.defineProperty(window, 'localStorage', { get() { throw new Error('no') } })")
    page.goto(address + CHOICES[0])
    answered(page, right=True)
    assert page.locator(".guess-result").first.inner_text().startswith("Right")
    assert not [error for error in failed if "guesses" in error]


def test_without_scripts_a_box_is_question_options_and_answer(browser: Browser, address: str) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(address + CHOICES[0])
    assert page.locator(".inbounds-guess legend").first.is_visible()
    assert page.locator(".guess-options li").first.is_visible()
    assert page.locator(".inbounds-guess input:visible, .guess-check:visible").count() == 0
    page.locator(".predict details summary").click()
    assert page.locator(".predict details").get_attribute("open") is not None
    context.close()
