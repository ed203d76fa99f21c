"""On how many robots a difference is found: each verdict counts once, and robots are named where one is found."""

import pytest

from inbounds.book.report.words import WAITS, by_robot


@pytest.mark.parametrize(
    ("verdicts", "said"),
    [
        ({"Ant": "unresolved"}, "no difference found on 1 of 1 robot"),
        ({"Ant": "higher", "Hopper": "higher"}, "above on 2 of 2 robots (Ant, Hopper)"),
        (
            {"Ant": "lower", "Hopper": "suggested above", "Swimmer": "unresolved", "Humanoid": WAITS},
            "below on 1 of 4 robots (Ant), suggested above on 1 (Hopper), "
            "seeds still to be run on 1 (Humanoid), no difference found on 1",
        ),
        ({"Ant": "", "Hopper": ""}, "above or below on none of 2 robots"),
    ],
)
def test_each_robot_is_counted_once(verdicts: dict[str, str], said: str) -> None:
    assert by_robot(list(verdicts.items())) == said
