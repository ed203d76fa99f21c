"""The second study's cells are those of `results/PROTOCOL-2.md`."""

import re

import pytest

from inbounds.learning import FAMILIES
from inbounds.learning.families import head_bias
from inbounds.study import Cell
from inbounds.study.grid import ROBOTS, SECOND, second_cells, select
from tests.study.test_grid import PROTOCOL, differences

TEXT = (PROTOCOL.parent / "PROTOCOL-2.md").read_text(encoding="utf8")
ROWS = {
    line.split("|")[1].strip(): [part.strip() for part in line.strip("|").split("|")]
    for line in TEXT.partition("| Block |")[2].partition("\n\n")[0].splitlines()[2:]
}
NAMES = {"Gaussian free σ": ("gaussian", False), "Gaussian σ(s)": ("gaussian", True)}
NAMES |= {"logit-normal free σ": ("logit-normal", False), "logit-normal": ("logit-normal", True)}
NAMES |= {"Beta": ("beta", True)}


def test_the_blocks_are_those_of_the_protocol() -> None:
    assert list(SECOND) == list(ROWS)
    for block, (_, arm, columns, robots, seeds, count) in ROWS.items():
        cells = SECOND[block]
        assert {cell.arm for cell in cells} == {arm.strip("`")}
        assert len(cells) == int(count)
        first, last = map(int, seeds.split("–"))
        assert {cell.seeds for cell in cells} == {tuple(range(first, last + 1))}
        algorithm, _, named = columns.partition(" × ")
        assert {cell.algorithm for cell in cells} == {algorithm.lower()}
        found = {(cell.family, cell.config.policy.state_dependent_std) for cell in cells}
        laws = named.strip("{").partition("}")[0] if "{" in named else named.partition(",")[0]
        assert found == {NAMES[name.strip()] for name in laws.split(",")}
        on = ROBOTS if robots == "all six" else tuple(robots.split(", "))
        assert tuple(dict.fromkeys(cell.robot for cell in cells)) == on


@pytest.mark.parametrize("cell", second_cells(), ids=lambda cell: cell.id)
def test_a_cell_differs_from_common_in_what_its_block_says(cell: Cell) -> None:
    plain = Cell("standard", cell.algorithm, cell.family, cell.robot)
    expected = {"seeds", "engine"}
    expected |= {"policy.initial_std"} if cell.arm != "as-they-come" else set()
    expected |= {"policy.state_dependent_std"} if "free-std" in (cell.variant, *cell.base) else set()
    expected |= {"algorithm.learning_rate"} if cell.arm == "steps" else set()
    assert differences(cell, plain) == expected
    concerned = cell.algorithm == "ppo" and (cell.family, cell.config.policy.state_dependent_std) == (
        "logit-normal",
        True,
    )
    assert (cell.config.engine, cell.version) == ("compiled", 3 if concerned else 2)


@pytest.mark.parametrize("block", SECOND)
def test_the_noise_can_be_had(block: str) -> None:
    asked = {"B": {0.4}, "B, more seeds": {0.4}, "C": {0.4}, "D": {None}, "E": {0.2, 0.55}, "F": {0.4}}
    assert {cell.config.policy.initial_std for cell in SECOND[block]} == asked[block]
    for cell in SECOND[block]:
        bias = head_bias(cell.config.policy)  # raises where no parameters give it
        assert (bias is None) == (block == "D")
    if block == "F":
        assert {cell.config.algorithm.learning_rate for cell in SECOND[block]} == {1e-4, 1e-3}


def test_no_beta_is_louder_than_the_uniform_law() -> None:
    assert f"{FAMILIES['beta'].executed_std(1.0):.3f}" in TEXT


def test_policies_are_kept_as_the_protocol_says() -> None:
    said = "The final policies of B are kept, of C and D those of the first five seeds; on Humanoid of the first three"
    assert said in TEXT
    for block, kept in {"B": 10, "C": 5, "D": 5, "B, more seeds": 0, "E": 0, "F": 0}.items():
        for cell in SECOND[block]:
            if (cell.family, cell.variant) == ("logit-normal", "free-std"):
                assert not cell.keeps_policies
                continue
            assert cell.keeps_policies == (kept > 0)
            if kept:
                assert cell.keeps_seeds == tuple(range(10, 10 + (3 if cell.robot == "Humanoid" else kept)))


def test_arms_can_be_named() -> None:
    assert {cell.arm for cell in select(["equal-more", "noise"])} == {"equal-more", "noise"}
    assert all(re.fullmatch(r"[a-z0-9.-]+", cell.id) for cell in second_cells())
