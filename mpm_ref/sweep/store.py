"""A folder of observed runs, so that no run is made twice.

A run is named by the hash of its scene, quantities, times, probes and of the package's source. A
damaged file counts as absent: the run is made again.
"""

import hashlib
import io
import json
import zlib
from functools import cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from ..core.jit import syntax
from ..store.atomic import write_bytes
from .observation import STOPPED, RunCost, RunObservation

PACKAGE = Path(__file__).resolve().parents[1]
COMPUTES = ("core", "hot", "materials", "sampling", "scene", "shapes", "sweep", "*.py")
PLAIN = ("outcome", "message", "until", "warnings", "indicators", "contacts")
UNREADABLE = (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, MemoryError,
              RuntimeError, BadZipFile, zlib.error)       # of a damaged file


class RunStore:
    """The observed runs in a folder; in memory alone where the folder is None."""

    def __init__(self, folder=None):
        self.folder = None if folder is None else Path(folder)
        self._memory = {}

    def get(self, run):
        """Return the `RunObservation` of an `ObservedRun`, or None.

        One that was stopped for its CPU time counts only where no more is allowed now.
        """
        key = key_of(run)
        if key not in self._memory and self.folder is not None:
            self._memory[key] = read(self.folder / f"{key}.npz")
        stored = self._memory.get(key)
        if stored is None or (stored.outcome == STOPPED and stored.cost.cpu < 0.9 * run.most_cpu):
            return None
        return stored

    def count(self):
        """Return the number of runs in the folder."""
        return 0 if self.folder is None else sum(1 for _ in self.folder.glob("*.npz"))

    def put(self, run, observation):
        """Store an observation. Raises `store.atomic.NotWritten`."""
        key = key_of(run)
        self._memory[key] = observation
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_bytes(self.folder / f"{key}.npz", packed(observation))


def key_of(run):
    """Return the name of a run: a hash of all that determines its observation but `most_cpu`."""
    digest = hashlib.sha256(source_hash().encode())
    digest.update(repr((run.digest, run.quantities, run.times, run.seed)).encode())
    for body, X in run.probes:
        digest.update(body.encode() + np.ascontiguousarray(X, dtype=float).tobytes())
    return digest.hexdigest()[:32]


@cache
def source_hash():
    """Return the hash of the sources that make a run, without comments and docstrings."""
    digest = hashlib.sha256()
    for name in COMPUTES:
        files = PACKAGE.glob(name) if "*" in name else (PACKAGE / name).rglob("*.py")
        for file in sorted(files):
            digest.update(str(file.relative_to(PACKAGE)).encode() + syntax(file.read_bytes()))
    return digest.hexdigest()


def packed(observation):
    """Return an observation as the bytes of an NPZ file."""
    facts = {name: getattr(observation, name) for name in PLAIN} | {"cost": vars(observation.cost)}
    arrays = {f"value {text}": value for text, value in observation.values.items()}
    stream = io.BytesIO()
    np.savez_compressed(stream, facts=np.array(json.dumps(facts)), **arrays)
    return stream.getvalue()


def read(path):
    """Return the observation in a file, or None where it is absent or damaged."""
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            facts = json.loads(str(file["facts"]))
            values = {name.removeprefix("value "): file[name] for name in file.files
                      if name != "facts"}
        cost = RunCost(**facts.pop("cost"))
        facts |= {name: tuple(facts[name]) for name in ("warnings", "contacts")}
        return RunObservation(values, cost, **facts)
    except UNREADABLE:
        return None
