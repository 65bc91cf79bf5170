"""Compare the software of a dask worker with that of this process."""

import hashlib
import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

from .. import __version__
from .tasks import sentence

PACKAGES = ("numba", "numpy", "scipy")      # which decide on the bits of results
SOURCE = "source of mpm_ref"


class BadScheduler(ValueError):
    """The text, the address or the workers of a scheduler are not fit for use."""


class WorkerMismatch(BadScheduler):
    """A dask worker has other software than the process that sends the tasks."""


@cache
def versions():
    """Return {name: version} of what must be the same wherever tasks run."""
    return {"Python": platform.python_version(), **{name: version(name) for name in PACKAGES},
            "mpm_ref": __version__, SOURCE: source_hash()}


def source_hash():
    """Return the hash of all files of this package's source."""
    root, digest = Path(__file__).parents[1], hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + b"\0")
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def disagreement(worker, facts, expected):
    """Return why a worker cannot perform tasks, in one sentence, or None.

    Args:
        worker: its name.
        facts: its (`versions`, number of threads), or the exception that it raised.
        expected: the versions of the process that sends the tasks.
    """
    if isinstance(facts, BaseException):
        return (f"the dask worker {worker} cannot import mpm_ref ({sentence(facts)}): install "
                f"mpm_ref {expected['mpm_ref']} there")
    there, threads = facts
    differing = [name for name in expected if there.get(name) != expected[name]]
    if differing:
        pairs = (f"{name} {there.get(name)}, not {expected[name]} as here" for name in differing)
        return (f"the dask worker {worker} has {', '.join(pairs)}: install the same versions "
                "there, or tasks would not give the same bits")
    if threads != 1:
        return (f"the dask worker {worker} performs {threads} tasks at a time in one process: "
                "start workers with --nthreads 1, and several with --nworkers")
    return None
