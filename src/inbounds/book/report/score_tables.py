"""Tables on the thesis's results: wins and losses by the protocol, what is found, and scores that others published."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from inbounds.book.report import html
from inbounds.book.report.html import Shown
from inbounds.book.report.words import ARM_NAMES, HEADS, pair_name, title_of
from inbounds.study import analysis
from inbounds.study.analysis import CONTRASTS, ENDPOINTS
from inbounds.study.grid import ROBOTS
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.statistics import Comparison
from inbounds.study.statistics.settings import LEVEL
from inbounds.study.words import p_equals, percent, spoken, verdict

_MOST = "“tended to surpass … in most of the environments”"  # of both policies; quotes.MOST has all of it
THESIS: Mapping[tuple[str, str, str], str] = {
    ("ppo", "logit-normal", "gaussian"): _MOST,
    ("ppo", "beta", "gaussian"): _MOST,
    ("ppo", "logit-normal", "beta"): "little difference; faster on 2",
    ("trpo", "logit-normal", "gaussian"): "ahead on 4, behind on 2",
}
"""Algorithm, first and second family → what chapter 5 of the source thesis says: quoted, or in this book's words."""

_WORDS = ("higher", "lower", "not after Holm", "unresolved", "missing")


def score_sheet(outcomes: Outcomes) -> Shown:
    """Return on how many robots each difference of mean final returns goes which way, beside what the thesis says."""
    rows: list[list[str]] = []
    waiting: list[str] = []
    for contrast in CONTRASTS:
        found = Counter(
            verdict(row) or "missing" for row in analysis.differences(outcomes, contrast, "final").values()
        )
        if found["missing"] == len(ROBOTS):  # noughts would read as a result
            waiting.append(f"{title_of(contrast.arm, contrast.algorithm)}, {pair_name(contrast)}")
            continue
        counts = [str(found[word]) for word in _WORDS]
        said = "" if contrast.arm == "beyond" else THESIS[contrast.algorithm, contrast.first, contrast.second]
        rows.append([title_of(contrast.arm, contrast.algorithm), pair_name(contrast), *counts, said])
    caption = (
        f"On how many of {len(ROBOTS)} robots the first family's mean final return is higher or lower "
        f"than the second's after "
        "Holm's correction; not after Holm: the interval leaves out 0, the corrected test does not; "
        "unresolved: the interval contains 0."
    )
    head = ["columns", "difference", *_WORDS, "the source thesis"]
    parts = [html.table(caption, head, rows, (0, 1, 7))] if rows else []
    if waiting:
        parts.append(html.missing(f"missing on all robots: {'; '.join(waiting)}."))
    return html.of_study("wins and losses", *parts)


def found_differences(outcomes: Outcomes, arm: str) -> Shown:
    """Return, robot by robot, every difference of an arm that some endpoint finds, with what the others say of it."""
    tested = {
        contrast: [analysis.differences(outcomes, contrast, endpoint) for endpoint in ENDPOINTS]
        for contrast in CONTRASTS
        if contrast.arm == arm
    }
    rows = []
    for robot in ROBOTS:
        for contrast, by_endpoint in tested.items():
            comparisons = [by_robot[robot] for by_robot in by_endpoint]
            if any(verdict(each) in ("higher", "lower") for each in comparisons):
                name = f"{robot}, {contrast.algorithm.upper()}\n{pair_name(contrast)}"
                rows.append([name, *map(_tested, comparisons)])
    what = f"what is found, {ARM_NAMES[arm]}"
    if not rows:
        return html.of_study(what, html.missing("No difference is found among the finished cells."))
    caption = (
        "Differences of means that are found by at least one endpoint: the interval leaves out 0, and so does the "
        f"permutation test after Holm's correction over {len(ROBOTS)} robots, whose p is given. In brackets a "
        f"{percent(LEVEL)} bootstrap interval. Final return and area are primary endpoints, the greedy return is "
        "secondary."
    )
    return html.of_study(what, html.table(caption, ["difference", *HEADS.values()], rows, range(4)))


def _tested(comparison: Comparison) -> str:
    # The interval has a line of its own, so that three columns fit a page.
    interval = spoken(comparison.difference).replace(" [", "\n[")
    return f"{interval}\n{verdict(comparison)}\n{p_equals(comparison.p_adjusted)}"


PUBLISHED: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "ppo": {
        "HalfCheetah": ("5783.9 ± 1244.0", "≈ 1700"),
        "Hopper": ("2609.3 ± 700.8", "≈ 2400"),
        "Swimmer": ("66.7 ± 99.1", "≈ 111"),
        "Walker2d": ("3588.5 ± 756.6", "≈ 3510"),
        "Ant": ("3258.4 ± 1079.3", "–"),
        "Humanoid": ("787.1 ± 193.5", "–"),
    },
    "trpo": {
        "HalfCheetah": ("4471.2 ± 804.9", "≈ 1350"),
        "Hopper": ("2046.0 ± 1037.9", "≈ 2200"),
        "Swimmer": ("40.9 ± 19.6", "≈ 95"),
        "Walker2d": ("3826.7 ± 782.7", "≈ 2350"),
        "Ant": ("2866.7 ± 707.9", "–"),
        "Humanoid": ("810.1 ± 126.1", "–"),
    },
}
"""Algorithm → robot → scores within one million steps as the README of Tianshou's MuJoCo benchmark prints them
(`examples/mujoco`): its own, on robots of version 3 (Gym 0.17.3, MuJoCo 2.0.2.13), and those of OpenAI Baselines on
version 2, which it has read off plots. Both use Gaussian policies. Tianshou's are largest points of mean learning
curves: its `analysis.py` takes the maximum over evaluations of the mean over runs, and the standard deviation there."""


def published(outcomes: Outcomes) -> Shown:
    """Return published scores of Gaussian policies beside the study's, with the metric of each."""
    rows = []
    for algorithm, scores in PUBLISHED.items():
        for robot in ROBOTS:
            outcome = outcomes.find(Column("standard", algorithm, "gaussian"), robot)
            ours = [spoken(analysis.estimate(outcome, e) if outcome else None) for e in ("final", "greedy")]
            rows.append([robot, algorithm.upper(), *scores[robot], *ours])
    caption = (
        "Gaussian policies within about a million steps. Tianshou, robots v3: largest mean over ten runs that any "
        "evaluation reached (ten test episodes per run), ± standard deviation over the runs at that point. Baselines, "
        "robots v2: read off plots by Tianshou's authors. This study, robots v5, standard practice: means over ten "
        "seeds, in brackets 95 % bootstrap intervals; final: training episodes of the last tenth; greedy: median "
        "action, last five evaluations."
    )
    head = [
        "robot",
        "algorithm",
        "Tianshou v3, largest",
        "Baselines v2",
        "this study v5, final",
        "this study v5, greedy",
    ]
    return html.of_study("beside published scores", html.table(caption, head, rows, (0, 1)))
