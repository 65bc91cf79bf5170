"""Describe a run so that it can be repeated: scene, code, versions, machine and resources used."""

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
from .text import plain

POOL = ("user_api", "internal_api", "version", "num_threads")
LIBRARIES = ("numpy", "numba", "llvmlite", "scipy", "h5py", "msgspec")


def manifest(problem, seed=None):
    """Return the description of a run at its start, as a dict of plain values.

    `parts` is empty; every part of the run adds an entry (see `RunPart`), a resumed run several.
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
    """Return the sha256 of the scene's canonical text.

    For a problem built in Python it is that of its parameters as text, without the particles.
    """
    text = problem.source or repr((
        [(body.name, len(body.id), *map(_in_full, (body.law, body.flow)))
         for body in problem.bodies],
        problem.dx, problem.clock, list(map(float, problem.gravity)), problem.scheme, problem.clip,
        *[(one.body, one.velocity.tolist(), one.length, one.start, one.blocks)
          for one in problem.sources],
        *[_in_full(one.shape) for one in problem.sinks],
        *[(one.body, one.sway) for one in problem.sources if one.sway is not None],
    ))
    return hashlib.sha256(text.encode()).hexdigest()


def _in_full(record):
    """Return a record of parameters; one with arrays as plain values, since the text of an array
    leaves out most of it.
    """
    return plain(record) if any(isinstance(value, np.ndarray) for value in record) else record


@cache
def source_hash():
    """Return the sha256 over all Python files of the package, in the order of their paths."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def code():
    """Return the hash of the package and the versions of the libraries."""
    return {"source_sha256": source_hash(), "versions": versions()}


def versions():
    """Return the versions of the package, of Python and of the numerical libraries."""
    libraries = {name: importlib.metadata.version(name) for name in LIBRARIES}
    return {"mpm_ref": __version__, "python": platform.python_version(), **libraries}


def machine():
    """Return processor, cores, threads and threading layers."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "threads": numba.get_num_threads(),
        "threading_layer": threading_layer(),
        "pools": [{key: pool.get(key) for key in POOL} for pool in threadpoolctl.threadpool_info()],
    }


def cpu_model():
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or "unknown")


def threading_layer():
    """Return Numba's threading layer, or the configured one before the first parallel kernel."""
    try:
        return numba.threading_layer()
    except ValueError:
        return str(numba.config.THREADING_LAYER)


def peak_memory():
    """Return the largest resident memory of this process so far [bytes]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def now():
    """Return date and time to the second, with the offset from UTC."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def count_unsolved(facts):
    """Return the number of implicit steps in a manifest whose solve did not converge."""
    return sum(part.get("unsolved", 0) for part in facts.get("parts", ()))


def count_so_far(facts, name):
    """Return the count "rejected" or "stalled" of `simulate.State` at the end of the last part in a
    manifest.
    """
    return max((part.get(name, 0) for part in facts.get("parts", ())), default=0)


def strain_warnings(facts):
    """Return all warnings in a manifest about strains beyond the training of learned laws."""
    return [one for part in facts.get("parts", ()) for one in part.get("strain_warnings", ())]


def error_warnings(facts):
    """Return all warnings in a manifest about errors that the run showed in itself."""
    return [one for part in facts.get("parts", ()) for one in part.get("error_warnings", ())]


@dataclass
class RunPart:
    """One uninterrupted part of a run, from its start or a checkpoint to where it ended."""

    first_step: int
    unsolved: int = 0
    strain_warnings: list = field(default_factory=list)      # sentences of `nclaw.strain_watch`
    error_warnings: list = field(default_factory=list)       # sentences of `indicators`
    cut_particle_steps: dict = field(default_factory=dict)   # {body: count}, see `learned.guard`
    energy_budget: dict = field(default_factory=dict)       # [J], see `energy_budget`
    code: dict = field(default_factory=code)
    began: str = field(default_factory=now)
    wall_start: float = field(default_factory=time.perf_counter)
    cpu_start: float = field(default_factory=time.process_time)

    def ended(self, why, state, digest):
        """Return the entry of this part in the manifest.

        It says why and where the part ended, the resources used, the number of implicit steps that
        did not converge, the rejected and stalled steps of the whole run so far, the warnings about
        strains and about errors that the run showed, how often the guard of a learned law cut
        strains, the energy budget, the sha256 of the last state, and the code.
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
            "rejected": state.rejected,
            "stalled": state.stalled,
            "strain_warnings": self.strain_warnings,
            "error_warnings": self.error_warnings,
            "cut_particle_steps": self.cut_particle_steps,
            "energy_budget": self.energy_budget,
            "state_sha256": digest,
            **self.code,
        }
