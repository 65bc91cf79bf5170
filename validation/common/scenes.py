"""Scenes in experiments: shipped ones with other sizes, and a body's mean motion."""

from contextlib import contextmanager
from pathlib import Path

import msgspec
import numba

from mpm_ref.core.jit import set_threads
from mpm_ref.scene import load

SCENES = Path(__file__).parents[2] / "scenes"
FEW = 5000


def catalogue_scene(name, **changes):
    """The scene ``scenes/<name>.toml`` with some of its keys replaced."""
    return with_(load(SCENES / f"{name}.toml"), **changes)


def with_(record, **changes):
    """A scene, or a table of one, with some of its keys replaced."""
    return msgspec.structs.replace(record, **changes)


def mean(body, name):
    """Mean of a particle field weighted by mass: "x" the centre [m], "v" its velocity [m/s]."""
    q = body.particles
    return q.m @ getattr(q, name) / q.m.sum()


@contextmanager
def threads_for(bodies):
    """Run on one thread if there are FEW particles: a second one would wait more than it works.

    The results are the same to the last bit.
    """
    before = numba.get_num_threads()
    few = sum(len(body.particles.x) for body in bodies) < FEW
    set_threads(1 if few else before)
    try:
        yield
    finally:
        set_threads(before)
