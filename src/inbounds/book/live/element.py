"""The live robot as an element of a page: films, and a button that brings the robots to life."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.drawing.variables import color_variables
from inbounds.book.live.export import NAMES
from inbounds.book.templates import macros
from inbounds.study.grid import ARMS, ROBOTS, THESIS
from inbounds.study.ways_played import ways_of

_HERE = Path(__file__).parent
_COLORS = {
    "light": {"ink": "#22272d", "line": "#5f6770", "box": "#e4e9ef", "clip": "#d1006c", "sky": "#e9eef4"},
    "dark": {"ink": "#ced6dd", "line": "#9ca4af", "box": "#2c3644", "clip": "#ff6fae", "sky": "#1b222c"},
}
_SEEDS = ARMS["standard"][0].kept_seeds
POLICIES = tuple(f"{algorithm}-{family}" for algorithm, family in THESIS)
"""What may move a robot: columns of arm 1, by algorithm and family."""


class Films(Protocol):
    """What stands on the page until the robots are asked for: `study_pages.films_of`, or a `VideoRow`."""

    def _repr_html_(self) -> str: ...


@dataclass(frozen=True)
class LiveRobot:
    """One or two robots that run in the reader's browser; a notebook shows the films.

    Made by `live_robot`, which has an example.
    """

    films: Films
    """Shown until the reader asks for the robots, and where they cannot run."""
    robot: str
    """As in `inbounds.study.grid.ROBOTS`."""
    left: str
    """What moves the first robot, of `POLICIES`."""
    right: str
    """What moves the second; empty for none."""
    seed: int
    """With which they were trained."""
    ways: tuple[str, str] = ("sample", "sample")
    """By what the first and the second act at the beginning, as in `inbounds.study.ways_played`."""

    def __repr__(self) -> str:
        """Return a line that never changes."""
        return f"Live robot: {self.robot}, {self.left}{f' beside {self.right}' if self.right else ''}"

    def _repr_html_(self) -> str:
        return str(
            macros("live").robot(
                self.films._repr_html_(),
                self.robot,
                self.left,
                self.right,
                self.seed,
                self.ways,
                style_sheet(),
            )
        )


def live_robot(
    films: Films,
    robot: str = "HalfCheetah",
    left: str = "ppo-gaussian",
    right: str = "ppo-logit-normal",
    seed: int = 0,
    ways: tuple[str, str] = ("sample", "sample"),
) -> LiveRobot:
    """Return an element for a page; in the built book it has a button that starts the robots.

    Args:
        films: what stands there until then.
        robot: as in `inbounds.study.grid.ROBOTS`.
        left: what moves the first robot: algorithm and family, as in `POLICIES`.
        right: what moves the second; empty for none.
        seed: with which both were trained, 0 to 9.
        ways: by what the first and the second act until the reader chooses: sample, mean, median, mode,
            median-snapped or sample-snapped, as the family has it.

    Raises:
        ValueError: there is no such robot, no such policy, no such seed, or no such way to act.

    Example:
        >>> from inbounds.book.drawing.videos import VideoRow
        >>> live_robot(VideoRow([]), "Hopper", "ppo-beta")
        Live robot: Hopper, ppo-beta beside ppo-logit-normal
    """
    if robot not in ROBOTS:
        raise ValueError(f"there is no robot {robot!r}; there are {', '.join(ROBOTS)}")
    for policy in (left, right or left):
        if policy not in POLICIES:
            raise ValueError(f"no policy {policy!r} was trained; there are {', '.join(POLICIES)}")
    if seed not in _SEEDS:
        raise ValueError(f"nobody was trained with seed {seed!r}: choose one of {_SEEDS[0]} to {_SEEDS[-1]}")
    for policy, way in zip((left, right or left), ways, strict=True):
        family = policy.partition("-")[2]
        if way not in ways_of(family):
            raise ValueError(f"{family} acts by {', '.join(ways_of(family))}, not by {way!r}")
    return LiveRobot(films, robot, left, right, seed, ways)


@functools.cache
def style_sheet() -> str:
    """Return the element's style, with the families' colours for both themes.

    Example:
        >>> "--inbounds-live-beta: #1F8277" in style_sheet()
        True
    """
    families = {name: LOOKS[name] for name in NAMES}
    variables = color_variables(".inbounds-live-robot", "inbounds-live", _COLORS, families)
    return "\n".join([variables, (_HERE / "live.css").read_text(encoding="utf8")])
