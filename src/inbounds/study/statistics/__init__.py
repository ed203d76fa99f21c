"""What a handful of seeds can say, and what it cannot: endpoints, intervals, comparisons, aggregates, power.

Everything here is a pure function of arrays, with the seeds on the first axis, as everywhere in this package. Chance
enters through an explicit `numpy.random.Generator` only, so that a figure's interval is the same tomorrow.

**A seed that is missing or diverged is NaN, and NaN is never averaged away in silence.** Every function refuses it
(`missing="raise"`, the default) or leaves the seed out *and says so* (`missing="exclude"`): the result carries `n`
and `missing`, and the figures show both.

* `endpoints` — from learning curves to one number per seed: area, final, normalised score.
* `intervals` — means and interquartile means over seeds with bootstrap intervals.
* `interval_coverage` — what an interval covers, and what few seeds cannot.
* `printed` — means and differences of means with the one interval that they have on every page.
* `comparisons` — differences of two policies, permutation tests, Holm.
* `equivalence_test` — whether two policies differ by less than a margin.
* `aggregates` — over environments: IQM, probability of improvement, performance profiles (Agarwal et al. 2021).
* `resolution` — which differences ten seeds can find.
"""

from inbounds.study.statistics.aggregates import (
    Profile,
    aggregate,
    performance_profile,
    probability_of_improvement,
)
from inbounds.study.statistics.comparisons import (
    Comparison,
    compare,
    difference,
    holm,
    holm_at_best,
    permutation_test,
)
from inbounds.study.statistics.endpoints import (
    area_under_curve,
    carry_forward,
    final_score,
    normalize_scores,
)
from inbounds.study.statistics.equivalence_test import Equivalence, equivalence
from inbounds.study.statistics.interval_coverage import coverage, coverage_ceiling
from inbounds.study.statistics.intervals import (
    Estimate,
    bootstrap,
    interquartile_mean,
    learning_curve,
)
from inbounds.study.statistics.printed import combination, compared, mean_of, minus
from inbounds.study.statistics.resolution import power, smallest_detectable_effect
from inbounds.study.statistics.seeds import MissingSeedError

__all__ = [
    "Comparison",
    "Equivalence",
    "Estimate",
    "MissingSeedError",
    "Profile",
    "aggregate",
    "area_under_curve",
    "bootstrap",
    "carry_forward",
    "combination",
    "compare",
    "compared",
    "coverage",
    "coverage_ceiling",
    "difference",
    "equivalence",
    "final_score",
    "holm",
    "holm_at_best",
    "interquartile_mean",
    "learning_curve",
    "mean_of",
    "minus",
    "normalize_scores",
    "performance_profile",
    "permutation_test",
    "power",
    "probability_of_improvement",
    "smallest_detectable_effect",
]
