import dataclasses
import json
import re
from collections import Counter
from pathlib import Path

import pytest

from inbounds.learning import preset
from inbounds.learning.storage import stored_config
from inbounds.learning.storage.stored_config import describe
from inbounds.study.cell import LEARNING_RATES, NOISES, VARIANTS, digest_of
from inbounds.study.grid import (
    AFTERWARDS,
    ARMS,
    ROBOTS,
    Cell,
    all_cells,
    second_cells,
    select,
    study_cells,
)
from inbounds.study.ledger import CLAIMS, claims_named
from inbounds.study.statistics import settings
from inbounds.study.store import StudyFolder

PROTOCOL = Path(__file__).parents[2] / "results" / "PROTOCOL.md"
FIRST_STUDY = (*study_cells(), *AFTERWARDS)
OF_THE_SECOND = {"free-std", *(f"noise-{s:g}" for s in NOISES), *(f"rate-{r:g}" for r in LEARNING_RATES)}


def differences(a: Cell, b: Cell) -> set[str]:
    def flat(values: dict, prefix: str = "") -> dict:
        found = {}
        for key, value in values.items():
            found |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value}
        return found

    ours, theirs = flat(describe(a.config)), flat(describe(b.config))
    return {key for key in ours | theirs if ours.get(key) != theirs.get(key)}


def test_the_arms_are_those_of_the_protocol() -> None:
    rows = re.findall(r"^\| \d (\w+) \|.*\| (\d+) \|$", PROTOCOL.read_text(), re.MULTILINE)
    assert {name: int(count) for name, count in rows} == {arm: len(cells) for arm, cells in ARMS.items()}
    assert [name for name, _ in rows] == list(ARMS)


def test_cells_of_later_are_told_apart_from_the_protocols() -> None:
    assert all_cells() == (*FIRST_STUDY, *second_cells())
    assert {cell.arm for cell in (*AFTERWARDS, *second_cells())}.isdisjoint(ARMS)
    assert {cell.arm for cell in AFTERWARDS}.isdisjoint(cell.arm for cell in second_cells())
    assert select() == study_cells()
    assert select(["afterwards"]) == AFTERWARDS
    assert not any(set(AFTERWARDS) & set(select(claim.cells)) for claim in CLAIMS if claim.cells)
    said = (PROTOCOL.parent / "AFTERWARDS.md").read_text(encoding="utf8")
    for cell in AFTERWARDS:
        assert f"{cell.algorithm.upper()} × {cell.family} on {cell.robot}" in said
        assert f"`{cell.variant}`" in said


def test_the_variants_are_those_of_the_protocol() -> None:
    table = PROTOCOL.read_text().partition("| Variant |")[2].partition("\n\n")[0]
    named = {}
    for line in table.splitlines()[2:]:
        cells = line.split("|")
        variants = re.findall(r"`([^`]+)`", cells[1])
        assert sum(cell.variant in variants for cell in ARMS["mechanisms"]) == int(cells[5])
        named |= dict.fromkeys(variants)
    asked_later = {cell.variant for cell in AFTERWARDS}
    assert named.keys() | asked_later == VARIANTS.keys() - OF_THE_SECOND - {""}


def test_the_numbers_of_the_analysis_are_those_of_the_protocol() -> None:
    table = PROTOCOL.read_text().partition("| Number | Value |")[2].partition("\n\n")[0]
    values = [line.split("|")[2].strip() for line in table.splitlines()[2:]]
    numbers = [float(value.removesuffix(" %")) / (100 if "%" in value else 1) for value in values]
    assert numbers == [
        settings.LEVEL,
        settings.RESAMPLES,
        settings.CURVE_RESAMPLES,
        settings.PROFILE_RESAMPLES,
        settings.PERMUTATIONS,
        settings.FINAL_FRACTION,
        settings.LAST_EVALUATIONS,
    ]


def test_autograds_digests_are_those_of_the_first_study() -> None:
    """Whose configurations did not name the engine; a cell of the other engine is another cell."""
    (cell,) = select(["standard-swimmer-ppo-gaussian"])
    assert cell.digest == "632bd5eab74623bd7553ec563c40a48a571ca93ee0495168a6fb153470e45f06"
    assert digest_of(dataclasses.replace(cell.config, engine="compiled")) != cell.digest


def test_ids_and_digests_are_unique_but_for_nothing() -> None:
    cells = all_cells()
    assert max(Counter(cell.id for cell in cells).values()) == 1
    assert max(Counter(cell.digest for cell in cells).values()) == 1
    assert all(re.fullmatch(r"[a-z0-9.-]+", cell.id) for cell in cells)


@pytest.mark.parametrize("arm", ARMS)
def test_one_robot_after_another(arm: str) -> None:
    order = [ROBOTS.index(cell.robot) for cell in ARMS[arm]]
    assert order == sorted(order)


def test_every_cell_has_the_full_length() -> None:
    for cell in all_cells():
        assert cell.config.epochs == 500
        assert cell.config.algorithm.horizon == 2048
    for cell in FIRST_STUDY:
        assert (cell.engine, cell.version, cell.base) == ("autograd", 1, ())
        assert cell.config.seeds == tuple(range(10))
        looked_into = cell.variant in ("matched-noise", "gamma-0.9999") or cell.id.startswith(
            "beyond-halfcheetah-"
        )
        looked_into |= cell.id == "beyond-swimmer-trpo-beta"
        assert cell.keeps_policies == (looked_into or cell.arm in ("standard", "afterwards"))


def test_an_option_that_came_later_had_its_default() -> None:
    config = Cell("test", "ppo", "beta", "Hopper").config
    stored = json.loads(json.dumps(describe(config)))
    assert stored_config.changed_fields(config, stored) == {}
    del stored["normalize_obs"], stored["algorithm"]["gamma"], stored["policy"]["limits"]
    later = dataclasses.replace(config, algorithm=dataclasses.replace(config.algorithm, gamma=0.9))
    assert stored_config.changed_fields(config, stored) == {}
    later = dataclasses.replace(later, normalize_obs=False)
    assert list(stored_config.changed_fields(later, stored)) == ["algorithm.gamma", "normalize_obs"]
    assert stored_config.changed_fields(config, stored | {"env": "Ant-v5"}) == {
        "env": ("Ant-v5", "Hopper-v5")
    }
    assert stored_config.changed_fields(config, stored | {"new": 1}) == {"new": (1, "absent")}
    assert "epochs" in stored_config.changed_fields(dataclasses.replace(config, epochs=9), stored)


def test_printed_cells_are_the_preset() -> None:
    for cell in ARMS["printed"]:
        assert cell.config == preset("as-printed", cell.config.env, policy=cell.family, algo=cell.algorithm)


@pytest.mark.parametrize("variant", sorted(VARIANTS.keys() - OF_THE_SECOND - {""}))
def test_a_variant_changes_one_thing(variant: str) -> None:
    changed = {
        "matched-noise": "policy.initial_std",
        "loud-noise": "policy.initial_std",
        "raw-cost": "action_mode",
        "gamma-0.9999": "algorithm.gamma",
        "printed-clip": "algorithm.clip_range",
        "printed-observations": "normalize_obs",
        "printed-advantages": "algorithm.normalize_advantage",
        "printed-gradients": "algorithm.max_grad_norm",
        "printed-weights": "network.initialization",
    }.get(variant, "algorithm.entropy_coef")
    for cell in [cell for cell in FIRST_STUDY if cell.variant == variant]:
        plain = Cell("standard", cell.algorithm, cell.family, cell.robot)
        assert differences(cell, plain) == {changed}


def test_one_factor_variants_take_the_printed_value() -> None:
    printed = Cell("printed", "ppo", "gaussian", "Hopper", preset="as-printed")
    plain = Cell("standard", "ppo", "gaussian", "Hopper")
    factors = [name for name in VARIANTS if name.startswith("printed-")]
    told_apart = set()
    for name in factors:
        cell = Cell("mechanisms", "ppo", "gaussian", "Hopper", name)
        (changed,) = differences(cell, plain)
        assert changed not in differences(cell, printed)
        told_apart.add(changed)
    assert differences(plain, printed) - told_apart == {"algorithm.adam_eps"}


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match="no variant 'entropy-1'; choose one of matched-noise"):
        Cell("test", "ppo", "beta", "Hopper", "entropy-1")
    with pytest.raises(ValueError, match="no robot 'Hopper-v5'; choose one of HalfCheetah"):
        Cell("test", "ppo", "beta", "Hopper-v5")
    with pytest.raises(ValueError, match="no cell matches ant, x-\\*: use an arm \\(standard, printed"):
        select(["standard", "ant", "x-*"])
    with pytest.raises(ValueError, match="no cell matches x: there are no cells to choose from"):
        select(["x"], ())


def test_selection_keeps_the_order() -> None:
    cells = select(["beyond", "standard-hopper-ppo-*"])
    assert [cell.arm for cell in cells] == ["standard"] * 3 + ["beyond"] * 18


def test_one_pattern_needs_no_list() -> None:
    assert select("beyond") == select(["beyond"])
    assert claims_named("kl") == claims_named(["kl"])


def test_a_folder_may_be_named_by_a_word(tmp_path: Path) -> None:
    (cell,) = select("standard-hopper-ppo-beta")
    folder = StudyFolder(str(tmp_path))  # type: ignore[arg-type]
    assert folder == StudyFolder(tmp_path)
    assert folder.state(cell) != "finished"
