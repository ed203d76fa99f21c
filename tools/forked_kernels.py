"""Kernels for executing many notebooks: those of one process are forked from a server that has imported the libraries.

A kernel that starts anew spends four seconds on importing what nearly every notebook imports, and one more on an
orderly end. `use` makes this process's kernels begin as copies of a fork server of the standard library, which has
imported that much, nothing of the chapters, and has started no thread; they end at once. Nothing else about them
differs: their environment, folder and process group are those that Jupyter asks for.

Two libraries are not among them: with EGL the import of MuJoCo opens the display, which must not be shared by a fork,
and Arrow's allocator starts a thread.
"""

import contextlib
import gc
import multiprocessing
import os
import runpy
import sys
import threading
from importlib.metadata import EntryPoint
from typing import Any

from jupyter_client.connect import KernelConnectionInfo
from jupyter_client.provisioning import KernelProvisionerFactory, LocalProvisioner

NAME = "forked"
HERE = os.path.dirname(__file__)
LIBRARIES = [
    "gymnasium",
    "ipykernel.kernelapp",
    "matplotlib.pyplot",
    "matplotlib_inline.backend_inline",
    "mediapy",
    "myst_nb",
    "numba",
    "safetensors.torch",
    "scipy.stats",
    "torch",
    "torch._dynamo",  # which the first optimiser imports
]
FORKS = multiprocessing.get_context("forkserver") if sys.platform == "linux" else None


def use() -> None:
    """Fork this process's kernels from now on; where forking is not safe (macOS, Windows) they start anew."""
    if FORKS is None:
        return
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"  # which every kernel sets
    FORKS.set_forkserver_preload(LIBRARIES)
    factory = KernelProvisionerFactory.instance()
    group, value = KernelProvisionerFactory.GROUP_NAME, f"{__name__}:{ForkedProvisioner.__name__}"
    factory.provisioners[NAME] = EntryPoint(NAME, value, group)
    factory.default_provisioner_name = NAME


class ForkedKernel:
    """A kernel's process, with what Jupyter asks of a `subprocess.Popen`."""

    stdin = stdout = stderr = None

    def __init__(self, command: list[str], environment: dict[str, str], folder: str) -> None:
        assert FORKS is not None
        self.process = FORKS.Process(target=_become, args=(command, environment, folder))
        self.process.start()
        assert self.process.pid is not None
        self.pid: int = self.process.pid

    def poll(self) -> int | None:
        """Return the exit status; None while it runs."""
        return self.process.exitcode

    def wait(self) -> int | None:
        """Wait for its end, and return the exit status."""
        self.process.join()
        return self.process.exitcode

    def send_signal(self, number: int) -> None:
        """Send it a signal; one that has ended by itself needs none."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)


class ForkedProvisioner(LocalProvisioner):
    """Where Jupyter gets a kernel's process from."""

    async def launch_kernel(self, cmd: list[str], **kwargs: Any) -> KernelConnectionInfo:
        """Begin the kernel that a command line starts."""
        self.process = ForkedKernel(cmd, kwargs["env"], kwargs.get("cwd") or os.getcwd())
        self.pid = self.pgid = self.process.pid
        return self.connection_info

    def get_shutdown_wait_time(self, recommended: float = 5.0) -> float:
        """Every output has been read by then: there is nothing to wait for."""
        return 0.0


def _become(command: list[str], environment: dict[str, str], folder: str) -> None:
    """Turn this new process into the kernel that a command line names (`python -m MODULE ARGUMENT ...`)."""
    gc.freeze()  # what the libraries have made is no garbage
    os.setsid()  # a group of its own, which is signalled as a whole
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ.update(environment)
    os.chdir(folder)
    module = command.index("-m") + 1
    # A kernel watches its parent, too. That is the fork server, which in turn stays as long as a kernel does.
    watched = f"--IPKernelApp.parent_handle={os.getppid()}"
    quiet = "--log-level=ERROR"  # it would warn that a local port is not encrypted
    sys.argv = [*command[module:], watched, quiet]
    sys.path[:] = [path for path in sys.path if path != HERE]
    runpy.run_module(command[module], run_name="__main__", alter_sys=True)


def _end_with_parent() -> None:
    """End this process when the one that asked for it has ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
