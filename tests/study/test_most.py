"""Both readings of one sentence are counted in the same way for both policies."""

import numpy as np
import pytest

from inbounds.book.report.score_tables import THESIS
from inbounds.study import StudyFolder, analysis, statistics
from inbounds.study.analysis import Contrast
from inbounds.study.grid import ROBOTS
from inbounds.study.ledger import claims_named, judge
from inbounds.study.ledger.most import NEEDED, Reading, readings
from inbounds.study.ledger.quotes import MOST
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.statistics import Comparison, Estimate


@pytest.fixture(scope="module")
def shipped() -> Outcomes:
    return Outcomes.read(StudyFolder())


@pytest.mark.parametrize("endpoint", ["final", "area"])
def test_the_loose_reading_is_a_difference_of_means(shipped: Outcomes, endpoint: str) -> None:
    """From the curves, without the package's comparison."""
    last = slice(-50, None) if endpoint == "final" else slice(None)
    for reading in readings(shipped, "standard", endpoint):
        higher = 0
        for robot in ROBOTS:
            two = [shipped.find(Column("standard", "ppo", f), robot) for f in (reading.policy, "gaussian")]
            first, second = (np.mean([r[last].mean() for r in o.returns]) for o in two if o is not None)
            higher += first > second
        assert (reading.higher, reading.there) == (higher, 6)


def test_the_strict_reading_is_what_the_ledger_counts(shipped: Outcomes) -> None:
    """Its rows ask for as many robots, and have as many for them."""
    for reading, row in zip(readings(shipped, "standard"), ("wins-beta", "wins-ppo"), strict=True):
        (claim,) = claims_named([f"{row}-standard"])
        assert claim.needed == NEEDED
        states = [each.state for each in judge(shipped, claim).statements]
        assert (reading.found, reading.lower) == (states.count("for"), states.count("against"))


def test_the_words_follow_from_the_counts() -> None:
    def words(higher: int, found: int, there: int, unclear: int = 0) -> tuple[str, str]:
        reading = Reading("beta", "final", higher, found, 0, there, found + unclear)
        return reading.loose, reading.strict

    assert words(4, 3, 6) == ("most", "not most")
    assert words(4, 2, 4) == ("most", "not yet known")
    assert words(0, 0, 2) == ("not yet known", "not yet known")
    assert words(0, 0, 3) == ("not most", "not most")
    assert words(3, 1, 4, unclear=1) == ("not yet known", "not yet known")
    assert words(4, 3, 6, unclear=0) == ("most", "not most")


def test_a_difference_may_be_found_when_other_robots_have_arrived(monkeypatch: pytest.MonkeyPatch) -> None:
    """A p of 0.02 is 0.12 where four of six tests are missing, and stays below 0.05 if those four are clear."""

    def compared(p_values: list[float]) -> Reading:
        gap = Estimate(np.array(5.0), np.array(1.0), np.array(9.0), 10, 0, 0.95, "mean")
        rows = {
            robot: Comparison(None if np.isnan(p) else gap, p, float(adjusted))
            for robot, p, adjusted in zip(ROBOTS, p_values, statistics.holm(p_values), strict=True)
        }
        monkeypatch.setattr(analysis, "differences", lambda *_: rows)
        return readings(Outcomes({}, {}, StudyFolder()), "standard")[0]

    nan = float("nan")
    reading = compared([0.02, 0.02, nan, nan, nan, nan])
    assert (reading.found, reading.findable, reading.strict) == (0, 2, "not yet known")
    reading = compared([0.02, 0.04, 0.04, 0.04, 0.04, nan])
    assert (reading.found, reading.findable, reading.strict) == (0, 0, "not most")
    reading = compared([0.001, 0.001, 0.015, 0.9, 0.9, nan])
    assert (reading.found, reading.findable, reading.strict) == (2, 3, "not yet known")


def test_an_unfinished_robot_counts_for_neither(shipped: Outcomes) -> None:
    for reading, policy in zip(readings(shipped, "printed"), ("beta", "logit-normal"), strict=True):
        compared = analysis.differences(shipped, Contrast("printed", "ppo", policy, "gaussian"), "final")
        assert reading.there == sum(each.difference is not None for each in compared.values())


def test_the_score_sheet_quotes_the_sentence_for_both() -> None:
    first, second = (THESIS["ppo", policy, "gaussian"] for policy in ("beta", "logit-normal"))
    assert first == second
    for part in first.strip("“”").split(" … "):
        assert part in MOST.words
