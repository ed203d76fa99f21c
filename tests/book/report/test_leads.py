"""What is left of a lead: only leads that are found stand there, each kind of start where there is an experiment."""

import pytest

from inbounds.book.report.equal_start import outcomes_of_both
from inbounds.book.report.leads import leads, leads_of
from inbounds.study.grid import AFTERWARDS, select
from inbounds.study.outcomes import Outcomes
from tests.study.small import folder_in
from tests.study.synthetic import write_cells


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> Outcomes:
    """Ant under TRPO, Gaussian and logit-normal, usual starts, quiet and loud; on Hopper only usual starts."""
    folder = folder_in(tmp_path_factory.mktemp("leads"))
    names = [
        f"standard-{robot}-trpo-{law}" for robot in ("ant", "hopper") for law in ("gaussian", "logit-normal")
    ]
    asked = ("afterwards-ant-trpo-gaussian-matched-noise", "afterwards-ant-trpo-logit-normal-loud-noise")
    write_cells(folder, [*select(names), *(cell for cell in AFTERWARDS if cell.id in asked)])
    return outcomes_of_both(Outcomes.read(folder))


def test_each_start_that_was_run(outcomes: Outcomes) -> None:
    found = {(lead.robot, lead.endpoint, lead.start) for lead in leads_of(outcomes)}
    starts = ("usual starts", "both quiet", "both loud")
    assert {each for each in found if each[0] == "Ant"} == {
        ("Ant", endpoint, start) for endpoint in ("final", "area") for start in starts
    }
    assert {start for robot, _, start in found if robot == "Hopper"} == {"usual starts"}


def test_a_difference_that_is_not_found_is_no_lead(outcomes: Outcomes, tmp_path) -> None:
    folder = folder_in(tmp_path)
    write_cells(
        folder, select(["standard-ant-trpo-gaussian", "standard-ant-trpo-logit-normal"]), noise=5000.0
    )
    assert leads_of(outcomes_of_both(Outcomes.read(folder))) == []
    assert "missing" in leads(outcomes_of_both(Outcomes.read(folder))).html
    assert "both loud" in leads(outcomes).html
