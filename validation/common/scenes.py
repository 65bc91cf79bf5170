"""Scenes of the catalogue with other keys, and helpers of experiments that run them."""

from contextlib import contextmanager
from pathlib import Path

import msgspec
import numba
import numpy as np

from mpm_ref.core.jit import set_threads
from mpm_ref.scene import load

SCENES = Path(__file__).parents[2] / "scenes"
FEW = 5000


def catalogue_scene(name, **changes):
    """Return the scene ``scenes/<name>.toml`` with some of its keys replaced."""
    return with_(load(SCENES / f"{name}.toml"), **changes)


def with_(record, **changes):
    """Return a scene, or a table of one, with some of its keys replaced."""
    return msgspec.structs.replace(record, **changes)


def mean(body, name):
    """Return the mean of a particle field weighted by mass: "x" [m] or "v" [m/s]."""
    q = body.particles
    return q.m @ getattr(q, name) / q.m.sum()


def particle_count(bodies):
    """Return the number of particles of all bodies."""
    return sum(len(body.id) for body in bodies)


def evenly(count, most):
    """Return at most `most` indices below `count`, evenly, the first and the last among them."""
    if count <= most:
        return list(range(count))
    return np.linspace(0, count - 1, most).round().astype(int).tolist()


@contextmanager
def threads_for(bodies):
    """Run on one thread if there are FEW particles: a second thread would mostly wait.

    The results are the same to the last bit.
    """
    before = numba.get_num_threads()
    few = sum(len(body.particles.x) for body in bodies) < FEW
    set_threads(1 if few else before)
    try:
        yield
    finally:
        set_threads(before)


def record_settings(run, scene, values):
    """Record {target id: our value} of a scene's settings, beside those that a paper prints."""
    for target, value in values.items():
        run.record(target, value, scale=f"scenes/{scene}.toml")
