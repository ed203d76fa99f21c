"""Only the job that publishes the book may write anything, and it runs for the main branch alone."""

from pathlib import Path

import pytest
import yaml

WORKFLOWS = sorted((Path(__file__).parents[1] / ".github" / "workflows").glob("*.yml"))


def test_there_is_a_workflow() -> None:
    assert WORKFLOWS


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_pull_request_may_read_only(path: Path) -> None:
    workflow = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert workflow["permissions"] == {"contents": "read"}
    for job in workflow["jobs"].values():
        if "permissions" in job:
            assert job["if"] == "github.ref == 'refs/heads/main'"


def test_publishing_may_write_pages() -> None:
    (ci,) = (path for path in WORKFLOWS if path.name == "ci.yml")
    publish = yaml.safe_load(ci.read_text(encoding="utf-8"))["jobs"]["publish"]
    assert publish["permissions"] == {"pages": "write", "id-token": "write"}
