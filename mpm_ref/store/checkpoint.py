"""Save and load checkpoints: the complete state of a run, from which it resumes bit for bit.

A checkpoint is a sealed HDF5 file (see `seal`): that it is truncated, altered or foreign is noticed
before HDF5 reads it. A new checkpoint replaces the previous one atomically.
"""

import hashlib
from pathlib import Path

import h5py
import numpy as np

from ..core.state import Particles
from ..energy import Energy
from ..monitor import Account
from ..simulate import State
from .atomic import replacing, require_space
from .journal import new_hdf5
from .manifest import scene_hash, source_hash
from .seal import CHECKPOINT, DAMAGED, UNSEALED, is_sealed, seal, verify

FORMAT = "mpm_ref checkpoint 1"
SUFFIX = ".checkpoint.h5"       # of the names of such files


class BadCheckpoint(ValueError):
    """A checkpoint from which a run cannot resume."""


def save(path, state, problem):
    """Save a `State` of a problem to `path`, replacing the previous checkpoint.

    The state must stand between two steps. Raises `NotWritten` and leaves the previous checkpoint.
    """
    require_space(path, size_of(state))
    with replacing(path) as part:
        with new_hdf5(part) as h5:
            _write(h5, state, problem)
        seal(part, CHECKPOINT)


def load(path, problem):
    """Return the `State` saved to `path` for a problem, and whether the same code saved it.

    A run is certain to resume bit for bit only under the same code. Laws and return maps come from
    the problem, everything else from the file. Raises `BadCheckpoint` for a file that is missing,
    damaged, or of another scene.
    """
    path = Path(path)
    _verify(path)
    with h5py.File(path, "r") as h5:
        saved = h5.attrs["scene_sha256"]
        if saved != scene_hash(problem):
            raise BadCheckpoint(f"{path} belongs to another scene (sha256 {saved[:12]}, this one "
                                f"is {scene_hash(problem)[:12]}); give the scene of that run, or "
                                "start a new one")
        return _read(h5, problem), h5.attrs["source_sha256"] == source_hash()


def is_checkpoint(path):
    """Return whether a file ends as checkpoints do; `summary` verifies its checksum."""
    return is_sealed(path, CHECKPOINT)


def has_checkpoint_name(path):
    """Return whether the name of a file is that of a checkpoint."""
    return str(path).endswith(SUFFIX)


def summary(path):
    """Return step, time [s], frames and scene hash of a checkpoint. Raises `BadCheckpoint`."""
    _verify(Path(path))
    with h5py.File(path, "r") as h5:
        return {"step": int(h5.attrs["step"]), "t": float(h5.attrs["t"]),
                "frames": int(h5.attrs["frame"]), "scene_sha256": h5.attrs["scene_sha256"]}


def size_of(state):
    """Return the size of a state's arrays [bytes]."""
    return sum(a.nbytes for body in state.bodies for a in (*body.particles, body.id))


def digest(state):
    """Return the sha256 of a state, equal for states from which a run continues identically."""
    a = state.account
    numbers = (state.step, state.t, state.frame, state.bound, *((*a.start, a.noise) if a else ()))
    out = hashlib.sha256(np.array(numbers, dtype=float))
    for body in state.bodies:
        for a in (*body.particles, body.id):
            out.update(repr((a.shape, a.dtype.str)).encode())
            out.update(np.ascontiguousarray(a))
    return out.hexdigest()


def _write(h5, state, problem):
    h5.attrs["format"] = FORMAT
    h5.attrs["scene_sha256"] = scene_hash(problem)
    h5.attrs["source_sha256"] = source_hash()
    for name in ("step", "t", "frame", "bound", "rejected", "stalled"):
        h5.attrs[name] = getattr(state, name)
    if state.account is not None:
        h5.attrs["account"] = [*state.account.start, state.account.noise]
    for k, body in enumerate(state.bodies):
        group = h5.create_group(f"bodies/{k}")
        group.attrs["name"] = body.name
        group.attrs["C is L"] = body.particles.C is body.particles.L
        for name, a in {**body.particles._asdict(), "id": body.id}.items():
            group.create_dataset(name, data=a, fletcher32=a.size > 0)


def _read(h5, problem):
    groups = [h5[f"bodies/{k}"] for k in range(len(h5["bodies"]))]
    if [g.attrs["name"] for g in groups] != [body.name for body in problem.bodies]:
        raise BadCheckpoint(f"{h5.filename} has other bodies than the problem; "
                            "give the scene of that run")
    bodies = tuple(body._replace(particles=_particles(g), id=g["id"][()])
                   for body, g in zip(problem.bodies, groups, strict=True))
    numbers = h5.attrs.get("account")
    account = None if numbers is None else Account(
        Energy(*map(float, numbers[:-1])), noise=float(numbers[-1]))
    return State(bodies, step=int(h5.attrs["step"]), t=float(h5.attrs["t"]),
                 frame=int(h5.attrs["frame"]), bound=float(h5.attrs["bound"]), account=account,
                 rejected=int(h5.attrs["rejected"]), stalled=int(h5.attrs["stalled"]))


def _particles(group):
    arrays = {name: group[name][()] for name in Particles._fields}
    if group.attrs["C is L"]:
        arrays["C"] = arrays["L"]
    return Particles(**arrays)


def _verify(path):
    """Raise `BadCheckpoint` unless the file is a checkpoint with a valid checksum."""
    if not path.is_file():
        raise BadCheckpoint(f"{path}: there is no such checkpoint")
    found = verify(path, CHECKPOINT)
    if found == UNSEALED:
        raise BadCheckpoint(f"{path} is cut short or is not a checkpoint of mpm_ref; "
                            "take another one, or start the run anew")
    if found == DAMAGED:
        raise BadCheckpoint(f"{path} is damaged: its bytes are not those that were written; "
                            "take a copy, or start the run anew")
