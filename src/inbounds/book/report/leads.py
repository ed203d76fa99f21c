"""What is left of a bounded law's lead once both sides start alike: usual starts, both quiet, both loud.

show = leads(outcomes_of_both(study_pages.shipped()))
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inbounds.book.report import html
from inbounds.book.report.as_they_come import compared
from inbounds.book.report.equal_start import laws, loud_starts
from inbounds.book.report.forests import Bar, in_words, of_robots
from inbounds.book.report.html import Shown
from inbounds.book.report.study_figures import SHORT
from inbounds.study.grid import ROBOTS
from inbounds.study.outcomes import Outcomes
from inbounds.study.second import MARGINS
from inbounds.study.second.yardsticks import ENDPOINTS
from inbounds.study.statistics import Estimate


@dataclass(frozen=True)
class Lead:
    """A law's lead over the Gaussian on a robot, from one kind of start.

    Made by `leads_of`, which has an example.
    """

    robot: str
    algorithm: str
    law: str
    endpoint: str
    start: str
    """usual starts, both quiet or both loud."""
    difference: Estimate
    """Law minus Gaussian."""
    study: int = 1
    """Whose cells."""

    @property
    def place(self) -> str:
        """What its group of bars is called."""
        return f"{self.robot}, {self.algorithm.upper()},\n{SHORT[self.law]}"


def leads_of(outcomes: Outcomes) -> list[Lead]:
    """Return the leads of final returns that are found as the families come, and what other starts leave of them.

    Args:
        outcomes: of both studies, as `equal_start.outcomes_of_both` returns them.

    Returns:
        Both endpoints of each; a start of which there is no experiment is left out.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.book.report.equal_start import outcomes_of_both
        >>> from inbounds.study import StudyFolder
        >>> leads_of(outcomes_of_both(Outcomes.read(StudyFolder(Path("no/results")))))
        []
    """
    rows = [row for arm in ("standard", "beyond") for row in compared(outcomes, arm)]
    rows = [row for row in rows if row.contrast.second == "gaussian"]
    found = {
        (row.robot, row.contrast.algorithm, row.contrast.first)
        for row in rows
        if row.endpoint == "final" and row.word == "higher"
    }
    plain = [
        Lead(
            row.robot,
            row.contrast.algorithm,
            row.contrast.first,
            row.endpoint,
            "usual starts",
            row.difference,
        )
        for row in rows
    ]
    alike = [
        Lead(row.robot, row.algorithm, row.law, row.endpoint, start, row.difference, row.study)
        for start, rows_of in (("both quiet", laws), ("both loud", loud_starts))
        for row in rows_of(outcomes)
    ]
    every = [*plain, *alike]
    return [each for each in every if (each.robot, each.algorithm, each.law) in found]


def leads(outcomes: Outcomes) -> Shown:
    """Return a forest of what each kind of start leaves of a lead, a panel an endpoint."""
    what = "what is left of a lead"
    found = sorted(leads_of(outcomes), key=lambda lead: (ROBOTS.index(lead.robot), lead.algorithm, lead.law))
    if not found:
        return html.of_study(what, html.NONE_FINISHED)
    panels = {name: _bars(found, endpoint) for endpoint, name in ENDPOINTS.items()}
    alt = f"Law minus Gaussian with 95 percent intervals, by the kind of start. {in_words(panels)}"
    stands_in = any(lead.start == "both quiet" and lead.study == 1 for lead in found)
    stand_ins = (
        " (hollow: cells of the first study, in which the law may have its usual start)" if stands_in else ""
    )
    caption = (
        "Law minus Gaussian, where that is found above 0 from the usual starts. Bars: 95 % bootstrap intervals, not "
        "corrected. Both quiet: executed noise 0.4 before training, in the second study, with fresh seeds and a "
        f"Gaussian whose σ is free, so that more than the start differs{stand_ins}. Both loud: the logit-normal "
        "executes 0.7, the Gaussian 0.72. Grey: too small to choose by. A bar that is not there is an experiment that "
        "nobody has run."
    )
    return html.of_study(what, html.figure_of(of_robots(panels), alt, caption))


def _bars(found: Sequence[Lead], endpoint: str) -> list[Bar]:
    return [
        Bar(
            lead.place,
            lead.start,
            lead.difference,
            MARGINS[endpoint][lead.robot],
            hollow=lead.start == "both quiet" and lead.study == 1,
        )
        for lead in found
        if lead.endpoint == endpoint
    ]
