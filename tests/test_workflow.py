"""What a pull request starts may only read; what publishes is off until a variable of the repository says otherwise."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
WORKFLOWS = {path.name: path for path in sorted((ROOT / ".github" / "workflows").glob("*.yml"))}
MAY_WRITE = {
    "pages.yml": {"publish": {"pages": "write", "id-token": "write"}},
    "release.yml": {"github": {"contents": "write"}, "pypi": {"id-token": "write"}},
}
SWITCHES = {"pages.yml": {"PUBLISH_PAGES"}, "release.yml": {"PUBLISH_RELEASE", "PUBLISH_PYPI"}}


def read(name: str) -> dict[Any, Any]:
    return yaml.safe_load(WORKFLOWS[name].read_text(encoding="utf-8"))


def ancestors(jobs: dict[str, Any], name: str) -> set[str]:
    """A job and all that it waits for."""
    needs = jobs[name].get("needs", [])
    return {name}.union(*(ancestors(jobs, each) for each in ([needs] if isinstance(needs, str) else needs)))


@pytest.mark.parametrize("name", WORKFLOWS)
def test_only_what_publishes_may_write(name: str) -> None:
    workflow = read(name)
    assert workflow["permissions"] == {"contents": "read"}
    jobs = workflow["jobs"].items()
    written = {job: rules["permissions"] for job, rules in jobs if "permissions" in rules}
    assert written == MAY_WRITE.get(name, {})


@pytest.mark.parametrize("name", MAY_WRITE)
def test_what_publishes_is_switched_on_by_hand(name: str) -> None:
    workflow = read(name)
    assert "pull_request" not in workflow[True]  # YAML reads the key `on` as a truth
    assert "pull_request_target" not in workflow[True]
    jobs = workflow["jobs"]
    for job in jobs:
        rules = [jobs[each].get("if", "") for each in ancestors(jobs, job)]
        assert any(re.match(r"vars\.PUBLISH_[A-Z]+ == 'true'", rule) for rule in rules), job
        assert not any(re.search(r"always\(\)|failure\(\)|\|\| vars", rule) for rule in rules)


@pytest.mark.parametrize("name", WORKFLOWS)
def test_the_switches_are_told(name: str) -> None:
    named = set(re.findall(r"vars\.(\w+)", WORKFLOWS[name].read_text(encoding="utf8")))
    assert named == SWITCHES.get(name, set())
    assert all(f"`{each}`" in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf8") for each in named)


def test_pages_are_those_of_a_push_that_passed() -> None:
    workflow = read("pages.yml")
    assert workflow[True]["workflow_run"] == {
        "workflows": [read("ci.yml")["name"]],
        "types": ["completed"],
        "branches": ["main"],
    }
    rule = workflow["jobs"]["build"]["if"]
    assert "workflow_run.event == 'push' && github.event.workflow_run.conclusion == 'success'" in rule


def test_a_release_is_what_passed() -> None:
    jobs = read("release.yml")["jobs"]
    (check,) = [name for name, job in jobs.items() if "uses" in job]
    assert jobs[check]["uses"] == f"./{WORKFLOWS['ci.yml'].relative_to(ROOT)}"
    assert "workflow_call" in read("ci.yml")[True]
    assert all({check, "build"} <= ancestors(jobs, job) for job in ("github", "pypi"))


@pytest.mark.parametrize("name", WORKFLOWS)
def test_every_action_has_a_version(name: str) -> None:
    for job in read(name)["jobs"].values():
        for step in job.get("steps", []):
            assert re.fullmatch(r"[\w./-]+@(v\d+|release/v\d+)", step.get("uses", "a@v1")), step


@pytest.mark.parametrize("name", WORKFLOWS)
def test_what_a_workflow_calls_is_there(name: str) -> None:
    targets = set(re.findall(r"^(\w+):.*##", (ROOT / "Makefile").read_text(encoding="utf8"), re.MULTILINE))
    for job in read(name)["jobs"].values():
        for step in job.get("steps", []):
            for target in re.findall(r"\bmake (\w+)", step.get("run", "")):
                assert target in targets
            for script in re.findall(r"\bpython (\S+\.py)", step.get("run", "")):
                assert (ROOT / script).is_file()
