"""On how many robots a difference is found: each verdict counts once, and robots are named where one is found."""

import pytest

from inbounds.book.report.words import WAITS, by_robot


@pytest.mark.parametrize(
    ("verdicts", "said"),
    [
        ({"Ant": "unresolved"}, "above on none of 1 robot, below on none, no difference found on 1"),
        ({"Ant": "higher", "Hopper": "higher"}, "above on 2 of 2 robots (Ant, Hopper), below on none"),
        (
            {"Ant": "lower", "Hopper": "suggested above", "Swimmer": "unresolved", "Humanoid": WAITS},
            "above on none of 4 robots, below on 1 (Ant), suggested above on 1 (Hopper), "
            "seeds still to be run on 1 (Humanoid), no difference found on 1",
        ),
    ],
)
def test_each_robot_is_counted_once(verdicts: dict[str, str], said: str) -> None:
    assert by_robot(list(verdicts.items())) == said
