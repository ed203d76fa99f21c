import pytest


@pytest.fixture(autouse=True)
def _peers_see_observations_in_float64(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stable-baselines3's `preprocess_obs` casts a Box's observations to float32: let them through as they are."""
    policies = pytest.importorskip("stable_baselines3.common.policies")
    monkeypatch.setattr(policies, "preprocess_obs", lambda obs, *args, **kwargs: obs)
