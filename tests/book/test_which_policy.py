"""The code of *Which policy?* runs pasted as it is, and starts as quietly as the page says."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from inbounds.book.pages.counts import plain
from tests.book.anatomy import cells_of, prose_of

PAGE = prose_of(Path(__file__).resolve().parents[2] / "notebooks" / "which_policy.ipynb")
PROGRAMS = dict(re.findall(r"\{tab-item\} (\S+)\n~~~python\n(.*?)^~~~$", PAGE, re.M | re.S))
SHORTER = {"EPOCHS = 500": "EPOCHS = 1", "STEPS, ROBOT = 1_000_000": "STEPS, ROBOT = 64"}
QUIET = """
def executed(actions):
    spread = float(np.clip(actions, -1, 1).std())
    assert abs(spread - 0.4) < 0.03, spread
import numpy as np
"""
MEASURED = {
    "inbounds": """
from inbounds.learning import Trainer
rollout = Trainer(replace(config, policy=quiet, seeds=(0, 1))).collector.collect(200)
executed(rollout.action.numpy())
assert action.shape == (2,) and len(run.policies) == 10
""",
    "stable-baselines3": """
import torch
obs = torch.zeros(3000, 17)
for policy in LAWS:
    fresh = quiet_start(PPO(policy, ROBOT, device="cpu")).policy
    with torch.no_grad():
        drawn = fresh(obs)[0].numpy()
    executed(drawn if policy == "MlpPolicy" else fresh.unscale_action(drawn))
assert len(models) == 3 and min(model.num_timesteps for model in models) >= STEPS
""",
    "TorchRL": """
executed(batch["action"].detach().numpy())
assert "latent" in batch.keys()
from torchrl.modules import NormalParamExtractor
loc, scale = NormalParamExtractor("biased_softplus_0.4")(torch.zeros(10_000, 2))
executed(torch.normal(loc, scale).numpy())
assert loss.actor_network is not None
""",
}


def test_it_is_read_in_two_minutes() -> None:
    """At the book's 150 words a minute, glued texts written out; without the fold and the programs, which are used."""
    path = Path(__file__).resolve().parents[2] / "notebooks" / "which_policy.ipynb"
    shown = {
        output.metadata.scrapbook.name: "".join(output.data.values()).strip("'")
        for cell in cells_of(path)
        for output in cell.get("outputs", [])
        if "scrapbook" in output.metadata
    }
    page = re.sub(r"^(`{4,})\{(?:dropdown|tab-set)\}.*?^\1$", "", PAGE, flags=re.M | re.S)
    page = re.sub(r"\{glue:text\}`([^`]+)`", lambda found: shown.get(found[1], "number"), page)
    words = re.findall(r"\w[\w’'.,%/+-]*", plain(page))
    assert 150 < len(words) <= 300


def test_each_library_has_a_program() -> None:
    assert 'NormalParamExtractor("biased_softplus_0.4")' in PROGRAMS["TorchRL"]
    assert set(PROGRAMS) == set(MEASURED)
    assert all(any(old in program for program in PROGRAMS.values()) for old in SHORTER)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("library", "law"),
    [*((library, "gaussian") for library in MEASURED), ("inbounds", "beta"), ("inbounds", "logit-normal")],
)
def test_the_program_runs_and_starts_quietly(library: str, law: str, tmp_path: Path) -> None:
    """In a process of its own; shortened in the one number that says how long it trains."""
    program = PROGRAMS[library]
    assert library != "inbounds" or 'LAW = "gaussian"' in program
    for old, new in (SHORTER | {'LAW = "gaussian"': f'LAW = "{law}"'}).items():
        program = program.replace(old, new)
    text = f"import warnings\nwarnings.simplefilter('ignore')\n{program}\n{QUIET}\n{MEASURED[library]}"
    done = subprocess.run(
        [sys.executable, "-c", text], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
