"""The numbers of the analysis, in one place: `results/PROTOCOL.md` states them, a test compares."""

LEVEL = 0.95
"""Nominal coverage of every interval."""
SIGNIFICANCE = 0.05
"""A difference is found where p is below it. Not `1 - LEVEL`, which is a little more: 0.05 is not below 0.05."""
RESAMPLES = 5000
"""Bootstrap replicates: enough that the ends of an interval move by a few hundredths of its width."""
MANY_RESAMPLES = 100_000
"""Bootstrap replicates of what is printed: the generator's luck moves an end by some thousandths of its width."""
CURVE_RESAMPLES = 1000
"""Bootstrap replicates of a learning curve, where the eye averages over neighbouring epochs."""
PROFILE_RESAMPLES = 2000
"""Bootstrap replicates of a performance profile."""
PERMUTATIONS = 9999
"""Permutations drawn by a test; the smallest p-value is one over one more."""
FINAL_FRACTION = 0.1
"""Of the epochs: the last ones, whose mean return is the final return."""
LAST_EVALUATIONS = 5
"""Evaluations, the last ones, whose mean is the greedy return."""
