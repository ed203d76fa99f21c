"""Returns of untrained policies that are kept agree with what is played now; nothing else is kept."""

import json
from pathlib import Path

import numpy as np
import pytest

from inbounds.study.ledger import untrained_returns as kept
from inbounds.study.ledger.untrained_returns import FILE, KEPT, play, untrained
from inbounds.study.running.verify import check_sums
from inbounds.study.store import StudyFolder


def test_the_file_has_what_is_kept_and_nothing_else() -> None:
    stored = json.loads(FILE.read_text(encoding="utf8"))
    assert set(stored) == {kept._name(*which) for which in KEPT}
    assert {len(values) for values in stored.values()} == {10}


def test_the_file_is_written_with_its_checksum(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stored = {kept._name(*which): untrained(*which).tolist() for which in KEPT}
    monkeypatch.setattr(kept, "FILE", tmp_path / FILE.name)
    monkeypatch.setattr(kept, "play", lambda *which: stored[kept._name(*which)])
    kept.main()
    assert (tmp_path / FILE.name).read_bytes() == FILE.read_bytes()
    assert all(finding.ok for finding in check_sums(StudyFolder(tmp_path)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "which", [("gaussian", "Hopper", None, "clip"), ("logit-normal", "HalfCheetah", 0.4, "clip")]
)
def test_played_again_the_means_agree(which: kept.Which) -> None:
    """On another processor single returns part; means over ten seeds stay within three standard errors."""
    stored, again = untrained(*which), play(*which)
    error = np.sqrt((stored.var(ddof=1) + again.var(ddof=1)) / 10)
    assert abs(stored.mean() - again.mean()) <= 3 * error


def test_what_is_kept_is_not_played(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "play", lambda *_: pytest.fail("played"))
    assert untrained("beta", "Walker2d", 0.4).shape == (10,)
    with pytest.raises(pytest.fail.Exception, match="played"):
        untrained("beta", "Ant")
