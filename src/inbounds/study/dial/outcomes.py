"""What the map shows, beside what was predicted: differences with intervals, classes, hits and misses.

The rule of `results/DIAL.md`, in code: a difference of means is *above*, *below* or *no difference*, by its
interval and a margin; a prediction is right if it names the class, wrong if it names another, and undecided where the
interval falls into none.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from inbounds.study.dial.cells import DialCell, dial_cells
from inbounds.study.dial.theory import MODELS, Model, predicted_curve
from inbounds.study.statistics import Estimate, area_under_curve, carry_forward, difference, final_score

MARGIN = 0.05  # of the way from doing nothing to the best action
DIAL_RESAMPLES = 100_000

Endpoint: TypeAlias = Literal["final", "area"]
Kind: TypeAlias = Literal["above", "below", "no difference", "unresolved"]
Score: TypeAlias = Literal["right", "wrong", "undecided"]
ENDPOINTS: tuple[Endpoint, ...] = ("final", "area")
COMPARISONS: tuple[tuple[str, str], ...] = (
    ("logit-normal", "gaussian-free"),
    ("beta", "gaussian-free"),
    ("logit-normal", "gaussian"),
    ("beta", "gaussian"),
    ("gaussian-free", "gaussian"),
)
"""First minus second: against the second study's Gaussian, then with σ(s) on both sides, then σ alone."""


def kind_of(low: float, high: float, margin: float = MARGIN) -> Kind:
    """Return the class of an interval.

    Example:
        >>> kind_of(0.01, 0.2), kind_of(-0.3, -0.1), kind_of(0.01, 0.04), kind_of(-0.1, 0.1)
        ('above', 'below', 'no difference', 'unresolved')
    """
    if -margin < low and high < margin:
        return "no difference"
    return "above" if low > 0 else "below" if high < 0 else "unresolved"


def score_of(predicted: Kind, found: Kind) -> Score:
    """Return whether a predicted class is right.

    Example:
        >>> score_of("above", "above"), score_of("above", "no difference"), score_of("below", "unresolved")
        ('right', 'wrong', 'undecided')
    """
    return "undecided" if found == "unresolved" else "right" if predicted == found else "wrong"


def endpoint_of(curves: NDArray[np.float64], endpoint: Endpoint) -> NDArray[np.float64]:
    """Return the endpoint `[...]` of curves `[..., E]`: final is the last tenth, area the mean."""
    return final_score(curves) if endpoint == "final" else area_under_curve(curves)


def predicted_difference(
    cell: DialCell, comparison: tuple[str, str], endpoint: Endpoint, model: Model = "steps"
) -> float:
    """Return the predicted difference of an endpoint under the knobs of a cell, whatever the cell's policy."""
    first, second = (
        endpoint_of(predicted_curve(DialCell(policy, cell.fraction, cell.cost, cell.dims), model), endpoint)
        for policy in comparison
    )
    return float(first - second)


def predicted_kind(
    cell: DialCell, comparison: tuple[str, str], endpoint: Endpoint, model: Model = "steps"
) -> Kind:
    """Return the predicted class: the difference's sign, or no difference within the margin."""
    gap = predicted_difference(cell, comparison, endpoint, model)
    return kind_of(gap, gap)


def settings() -> tuple[DialCell, ...]:
    """Return one cell per setting of the knobs, in the map's order."""
    return tuple(cell for cell in dial_cells() if cell.policy == "gaussian")


@dataclass(frozen=True)
class Finding:
    """One comparison at one setting of the knobs: what was found, what was predicted.

    Made by `DialOutcomes.findings`.
    """

    setting: DialCell
    comparison: tuple[str, str]
    endpoint: Endpoint
    found: Estimate
    predicted: dict[Model, Kind]

    @property
    def kind(self) -> Kind:
        """The class of the interval."""
        return kind_of(float(self.found.low), float(self.found.high))

    def score(self, model: Model = "steps") -> Score:
        """Return whether a model's prediction is right."""
        return score_of(self.predicted[model], self.kind)


class DialOutcomes:
    """The map's curves, and what follows from them.

    Args:
        table: of `DialFolder.read`.

    Example:
        >>> from inbounds.study.dial.running import run_cell
        >>> tables = [run_cell(DialCell("gaussian", 0.5, seeds=(900, 901), epochs=2))]
        >>> DialOutcomes(pa.concat_tables(tables)).curves(DialCell("gaussian", 0.5)).shape
        (2, 2)
    """

    def __init__(self, table: pa.Table) -> None:
        names, position = np.unique(table["cell"].to_numpy(zero_copy_only=False), return_inverse=True)
        self._rows = {str(name): np.flatnonzero(position == i) for i, name in enumerate(names)}
        self._columns = {name: table[name].to_numpy() for name in table.column_names if name != "cell"}

    def curves(self, cell: DialCell, column: str = "score") -> NDArray[np.float64]:
        """Return a column of a cell, `[S, E]`; a diverged seed's last score is carried on."""
        rows = self._rows[cell.id]
        epochs = int(self._columns["epoch"][rows].max()) + 1
        values = self._columns[column][rows].astype(np.float64).reshape(epochs, -1).T
        return carry_forward(values) if column == "score" else values

    def scores(self, cell: DialCell, endpoint: Endpoint) -> NDArray[np.float64]:
        """Return an endpoint of a cell, `[S]`."""
        return endpoint_of(self.curves(cell), endpoint)

    def gap(self, first: DialCell, second: DialCell, endpoint: Endpoint) -> Estimate:
        """Estimate the difference of two cells' means, its generator named after both."""
        rng = np.random.default_rng(zlib.crc32(f"{first.id} {second.id} {endpoint}".encode()))
        pair = (self.scores(first, endpoint), self.scores(second, endpoint))
        return difference(*pair, rng, statistic="mean", resamples=DIAL_RESAMPLES)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Every comparison and endpoint at every setting of the knobs."""
        found = []
        for setting in settings():
            for comparison in COMPARISONS:
                cells = [DialCell(p, setting.fraction, setting.cost, setting.dims) for p in comparison]
                for endpoint in ENDPOINTS:
                    predicted = {m: predicted_kind(setting, comparison, endpoint, m) for m in MODELS}
                    gap = self.gap(cells[0], cells[1], endpoint)
                    found.append(Finding(setting, comparison, endpoint, gap, predicted))
        return tuple(found)

    def cost_changes(self) -> dict[str, Estimate]:
        """Return, per policy, fraction and endpoint, what the cost on the executed action changes: nothing, it says."""
        return {
            f"{cell.policy} f={cell.fraction:g} {endpoint}": self.gap(
                cell, DialCell(cell.policy, cell.fraction), endpoint
            )
            for cell in dial_cells()
            if cell.cost == "executed"
            for endpoint in ENDPOINTS
        }


def tally(findings: Iterable[Finding], model: Model = "steps") -> Counter[Score]:
    """Count a model's right, wrong and undecided predictions."""
    return Counter(finding.score(model) for finding in findings)


def constant_guess(findings: Sequence[Finding]) -> tuple[Kind, int]:
    """Return the class that is right most often if it is guessed everywhere, and how often."""
    counts = Counter(finding.kind for finding in findings if finding.kind != "unresolved")
    return counts.most_common(1)[0] if counts else ("unresolved", 0)
