"""MuJoCo's messages reach Python's warnings, all but the known one."""

import subprocess
import sys
import warnings

import gymnasium
import mujoco
import pytest

from inbounds.robots import messages

messages.install_handler()


@pytest.fixture
def unstable(tmp_path, monkeypatch):
    """A simulation that cannot go on, in a working directory that must stay empty."""
    monkeypatch.chdir(tmp_path)
    env = gymnasium.make("Hopper-v5")
    env.reset(seed=0)
    env.unwrapped.data.qvel[:] = 1e20
    yield env.unwrapped
    assert not list(tmp_path.iterdir())


def test_the_known_message_is_dropped(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    gymnasium.make("HalfCheetah-v5")  # the model file uses the attribute; a warning here would be an error
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())


def test_every_other_message_is_a_warning(unstable, capfd):
    with pytest.warns(messages.MujocoWarning, match="unstable"):
        mujoco.mj_step(unstable.model, unstable.data)
    assert capfd.readouterr() == ("", "")


def test_a_similar_message_is_passed_on():
    with pytest.warns(messages.MujocoWarning, match="attribute 'other' is deprecated"):
        messages._handle("compiler attribute 'other' is deprecated")


def test_a_warning_made_an_error_is_kept_for_later_and_raised_once(unstable):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mujoco.mj_step(unstable.model, unstable.data)  # raising here would end the process
    with pytest.raises(messages.MujocoWarning, match="unstable"):
        messages.raise_pending()
    messages.raise_pending()


def test_without_python_filters_nothing_is_lost(tmp_path):
    code = "from inbounds.robots import messages; messages._handle('something new')"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert "MujocoWarning: something new" in done.stderr
