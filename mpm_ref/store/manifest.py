"""What must be known to make a result again: scene, code, versions, machine; and what it took."""

import hashlib
import importlib.metadata
import os
import platform
import resource
import sys
import time
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from pathlib import Path

import numba
import numpy as np
import threadpoolctl

from .. import __version__
from .words import plain

POOL = ("user_api", "internal_api", "version", "num_threads")
LIBRARIES = ("numpy", "numba", "llvmlite", "scipy", "h5py", "msgspec")


def manifest(problem, seed=None):
    """The facts of a run at its start, as a dict of what JSON knows. `parts` gets an entry for
    every part of the run, as a resumed one has several; see `Part`.
    """
    return {
        "title": problem.title,
        "scene": problem.source,
        "scene_sha256": scene_hash(problem),
        "seed": seed,
        **code(),
        "machine": machine(),
        "parts": [],
    }


def scene_hash(problem):
    """sha256 of the scene's canonical text; for a problem built in Python of its rules in words,
    without the particles.
    """
    text = problem.source or repr((
        [(body.name, len(body.id), *map(_in_full, (body.law, body.flow)))
         for body in problem.bodies],
        problem.dx, problem.clock, list(map(float, problem.gravity)), problem.scheme, problem.clip,
    ))
    return hashlib.sha256(text.encode()).hexdigest()


def _in_full(record):
    """A record of parameters; one that holds arrays as plain values, since their text would leave
    out most of them.
    """
    return plain(record) if any(isinstance(value, np.ndarray) for value in record) else record


@cache
def source_hash():
    """sha256 over all Python files of the package, in the order of their paths."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def code():
    """The code that computes, as facts: the hash of the package, and versions."""
    return {"source_sha256": source_hash(), "versions": versions()}


def versions():
    """Versions of the package, of Python and of the libraries that compute."""
    found = {name: importlib.metadata.version(name) for name in LIBRARIES}
    return {"mpm_ref": __version__, "python": platform.python_version(), **found}


def machine():
    """Processor, cores, threads, threading layers."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "threads": numba.get_num_threads(),
        "threading_layer": threading_layer(),
        "pools": [{key: pool.get(key) for key in POOL} for pool in threadpoolctl.threadpool_info()],
    }


def cpu_model():
    """The processor's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or "unknown")


def threading_layer():
    """Numba's threading layer; the one it will take, if no parallel kernel has run yet."""
    try:
        return numba.threading_layer()
    except ValueError:
        return str(numba.config.THREADING_LAYER)


def peak_memory():
    """Largest resident memory of this process so far [bytes]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def now():
    """Date and time with the offset from UTC, to the second."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def unsolved(facts):
    """Implicit steps of all parts of a manifest whose solve did not converge."""
    return sum(part.get("unsolved", 0) for part in facts.get("parts", ()))


def astray(facts):
    """What all parts of a manifest say of strains that learned laws had not seen."""
    return [said for part in facts.get("parts", ()) for said in part.get("astray", ())]


@dataclass
class Part:
    """One uninterrupted part of a run: from its start, or a checkpoint, to wherever it ended."""

    first_step: int
    unsolved: int = 0
    astray: list = field(default_factory=list)      # sentences of `nclaw.strain_watch`
    code: dict = field(default_factory=code)
    began: str = field(default_factory=now)
    wall_start: float = field(default_factory=time.perf_counter)
    cpu_start: float = field(default_factory=time.process_time)

    def ended(self, why, state, digest):
        """The entry of `parts` in the manifest: why it ended, where, what it took, the implicit
        steps that were not solved, what learned laws had not seen, the sha256 of the state it
        ended with and the code that ran.
        """
        return {
            "began": self.began,
            "ended": now(),
            "why": why,
            "first_step": self.first_step,
            "last_step": state.step,
            "t": state.t,
            "wall_s": round(time.perf_counter() - self.wall_start, 3),
            "cpu_s": round(time.process_time() - self.cpu_start, 3),
            "peak_bytes": peak_memory(),
            "unsolved": self.unsolved,
            "astray": self.astray,
            "state_sha256": digest,
            **self.code,
        }
