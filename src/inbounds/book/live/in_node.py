"""Runs the page's scripts in node, without a page: what the tests and the benchmark compare with Python."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from inbounds.book.live import export
from inbounds.book.live.packages import bundle
from inbounds.book.live.site import scripts
from inbounds.book.npm import node
from inbounds.study.grid import Cell
from inbounds.study.store import StudyFolder

# MuJoCo's loader would take node for node and import modules; the page's scripts want to be told that they are alone.
_DRIVER = """
const vm = require("node:vm");
const fs = require("node:fs");
const { files, code, values } = JSON.parse(fs.readFileSync(0, "utf8"));
const { exit, stdout } = process;
globalThis.inbounds = { live: { robots: {}, policies: {}, starts: {} } };
const run = () => { for (const file of files) vm.runInThisContext(fs.readFileSync(file, "utf8"), file); };
(async () => {
  const hidden = globalThis.process;
  delete globalThis.process;
  globalThis.window = globalThis;
  run();
  const { live } = inbounds;
  const mujoco = live.engine && await live.engine.load({
    wasmBinary: new Uint8Array(await live.unpack(live.wasm)), print() {}, printErr() {},
  });
  globalThis.process = hidden;
  const result = await vm.runInThisContext(`(async (live, mujoco, values) => {${code}})`)(live, mujoco, values);
  stdout.write(JSON.stringify(result), () => exit.call(hidden, 0));
})().catch((error) => { console.error(error); exit.call(globalThis.process ?? process, 1); });
"""


def run(
    code: str, values: Any = None, *, files: Sequence[Path] = (), engine: bool = True, patience: float = 900
) -> Any:
    """Return what JavaScript returns.

    Args:
        code: the body of an async function of `live`, `mujoco` and `values`.
        values: anything that JSON can hold.
        files: scripts to run before it, such as robots and policies.
        engine: start MuJoCo; without, `mujoco` is undefined and npm is not needed.
        patience: seconds until it is stopped.

    Raises:
        NpmError: there is no node, or MuJoCo is asked for and npm cannot be reached.
        RuntimeError: the code failed; the message is node's.

    Example:
        >>> run("return values.map((x) => 2 * x)", [1, 2], engine=False)
        [2, 4]
    """
    made = [bundle() / name for name in ("engine.js", "wasm.js")] if engine else []
    listed = [str(path) for path in (*made, *scripts(drawn=False), *files)]
    done = subprocess.run(
        [node(), "-e", _DRIVER],
        input=json.dumps({"files": listed, "code": code, "values": values}),
        capture_output=True,
        text=True,
        check=False,
        timeout=patience,
    )
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])
    return json.loads(done.stdout)


def run_cell(code: str, cell: Cell, seed: int, values: Any = None, *, untrained: bool = False) -> Any:
    """Return what JavaScript returns, given also `player`, the policy of a cell's seed in its robot.

    Args:
        code: as for `run`.
        cell: which keeps its policies.
        seed: with which the policy was trained.
        values: as for `run`.
        untrained: the network before training.

    Raises:
        NpmError: as `run`.
        RuntimeError: as `run`.

    Example:
        >>> from inbounds.study.grid import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> run_cell("return player.world.dt", cell, 0)  # doctest: +SKIP
        0.008
    """
    stored = dict(export.policies(cell, StudyFolder.shipped()))[
        f"{cell.robot.lower()}-{export.policy_id(cell)}-{seed}"
    ]
    start = dict(export.starts(cell))[f"{cell.robot.lower()}-{seed}"] if untrained else None
    given = {"robot": export.robot(cell.robot), "stored": stored, "start": start, "values": values}
    make = """
      const { robot, stored, start } = values;
      const numbers = await live.unpack(stored.numbers);
      const policy = new live.Policy(stored, numbers, start && (await live.unpack(start)));
      const player = new live.Player(new live.World(mujoco, robot), policy);
      values = values.values;
    """
    return run(make + code, given)
