"""Scenes in experiments: shipped ones with other sizes, and a body's mean motion."""

from contextlib import contextmanager
from pathlib import Path

import msgspec
import numba

from mpm_ref.core.jit import set_threads
from mpm_ref.scene import load

SCENES = Path(__file__).parents[2] / "scenes"


def shipped(name, **changes):
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
def one_thread():
    """Run on one thread: with few particles a second one waits more than it works.

    The results are the same to the last bit.
    """
    before = numba.get_num_threads()
    set_threads(1)
    try:
        yield
    finally:
        set_threads(before)
