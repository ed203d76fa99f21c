"""The explorer as an element of a page: choices, curves, forest and sentence; without JavaScript the static figure."""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from inbounds.book.drawing.alt_text import svg_bytes
from inbounds.book.drawing.figures import LOOKS
from inbounds.book.explorables.frame import DASHES
from inbounds.book.explorer.assets import carried_scripts, style_sheet
from inbounds.book.explorer.choices import choices, kept_of
from inbounds.book.report.arms import Part
from inbounds.book.report.html import NONE_FINISHED
from inbounds.book.report.study_figures import Curve, learning_curves
from inbounds.book.report.words import in_words
from inbounds.book.templates import macros, script_json
from inbounds.study.analysis import curve, estimate
from inbounds.study.grid import COMPARED, ROBOTS
from inbounds.study.outcomes import Outcome, Outcomes

ELEMENT = "inbounds-study-explorer"
FIRST: Mapping[str, Any] = {
    "start": "standard",
    "algorithm": "ppo",
    "endpoint": "final",
    "families": COMPARED,
    "robots": ROBOTS,
}
"""What is chosen until the reader chooses, and what the static figure shows, unless a page says otherwise."""


@dataclass(frozen=True)
class StudyExplorer:
    """The study to choose from, in the reader's browser; a stored notebook keeps a few words.

    Made by `study_explorer`, which has an example.
    """

    data: dict[str, Any]
    """Of `choices`."""
    static: str
    """HTML that stands there without JavaScript and in print."""
    first: Mapping[str, Any]
    """What is chosen until the reader chooses, as `FIRST`."""

    def __repr__(self) -> str:
        """Return a line that never changes."""
        return "<study: to choose from, robots, algorithm, families, endpoint and start>"

    def _repr_html_(self) -> str:
        looks = {family: {"dash": DASHES[look.linestyle]} for family, look in LOOKS.items()}
        return str(
            macros("explorer").explorer(
                self.data,
                script_json(self.data | {"looks": looks}),
                self.first,
                self.static,
                style_sheet(ELEMENT),
                carried_scripts(ELEMENT),
            )
        )


def study_explorer(outcomes: Outcomes, **first: Any) -> StudyExplorer:
    """Return the study to choose from: robots, algorithm, families, endpoint and start.

    Args:
        outcomes: of the first study, as `study_pages.shipped` reads them; the second's are read from the same folder.
        **first: what is chosen at first, where that is not as in `FIRST`.

    Raises:
        TypeError: `FIRST` has no such choice.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study.store import StudyFolder
        >>> study_explorer(Outcomes.read(StudyFolder(Path("no/results"))))
        <study: to choose from, robots, algorithm, families, endpoint and start>
    """
    if unknown := first.keys() - FIRST.keys():
        raise TypeError(f"no such choice: {', '.join(sorted(unknown))}; there are {', '.join(FIRST)}")
    chosen = {**FIRST, **first}
    return StudyExplorer(choices(outcomes), _static(outcomes, chosen), chosen)


def _static(outcomes: Outcomes, first: Mapping[str, Any]) -> str:
    """Return the curves of the first choice, from the usual starts, as a picture, with as few epochs as it takes."""
    algorithm = first["algorithm"]
    begun = {
        robot: {family: outcome for family, outcome in row.items() if family in first["families"]}
        for robot, row in Part.of(outcomes, "standard", algorithm).begun.items()
        if robot in first["robots"]
    }
    if not begun:
        return NONE_FINISHED

    def thinned(outcome: Outcome | None) -> Curve | None:
        band = curve(outcome) if outcome else None
        if outcome is None or band is None:
            return None
        kept = kept_of(len(outcome.steps))[::2]
        low, value, high = (np.asarray(each)[kept] for each in (band.low, band.value, band.high))
        return Curve(outcome.steps[kept], dataclasses.replace(band, low=low, value=value, high=high))

    fig = learning_curves(
        {robot: {family: thinned(o) for family, o in row.items()} for robot, row in begun.items()},
        ylabel="return of training episodes",
    )
    finals = {
        robot: {family: estimate(o, "final") if o else None for family, o in row.items()}
        for robot, row in begun.items()
    }
    what = f"Learning curves, {algorithm.upper()}, from the usual starts, a panel per robot"
    alt = f"{what}. Mean final returns: {in_words(finals)}"
    picture = base64.b64encode(svg_bytes(fig)).decode("ascii")
    plt.close(fig)
    return str(macros("explorer").static(picture, alt, algorithm))
