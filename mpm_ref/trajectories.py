"""Full-order runs of one body, recorded step by step: the data of reduced models and of learned
laws.
"""

from typing import NamedTuple

import numpy as np

from .body import restore_order
from .simulate import simulate


class BodyHistory(NamedTuple):
    """One run: time levels 0 .. k, points in the body's own order."""

    x: np.ndarray       # (k + 1, n, d)     position [m]
    F: np.ndarray       # (k + 1, n, d, d)  deformation gradient
    v: np.ndarray       # (k + 1, n, d)     velocity [m/s]


class Observed(NamedTuple):
    """One run with all fields that particles carry from step to step."""

    x: np.ndarray       # (k + 1, n, d)     position [m]
    v: np.ndarray       # (k + 1, n, d)     velocity [m/s]
    C: np.ndarray       # (k + 1, n, d, d)  affine velocity field [1/s]
    F: np.ndarray       # (k + 1, n, d, d)  deformation gradient


def history(problem, every=1):
    """Return the `BodyHistory` of one point in `every` of a problem. Raises ValueError as
    `recorded`.
    """
    return recorded(problem, BodyHistory, every)


def observed(problem):
    """Return the `Observed` run of a problem; F is J^(1/d) I of a fluid that carries J alone
    (NCLAW-eq21). Raises ValueError as `recorded`, and for a body without C.
    """
    if problem.bodies[0].particles.C.ndim != 3:
        raise ValueError(f"{problem.title!r}: a body that carries no C: expected the transfer apic "
                         "or mls")
    run = recorded(problem, Observed)
    if run.F.ndim == 2:
        d = run.x.shape[-1]
        run = run._replace(F=run.F[..., None, None] ** (1.0 / d) * np.eye(d))
    return run


def recorded(problem, kind, every=1):
    """Return the fields of a NamedTuple `kind`, of one point in `every`, over a run of a problem of
    one body that shows every step.

    Raises ValueError for more bodies, for sources and sinks, and for a clock that shows fewer
    frames.
    """
    if len(problem.bodies) != 1:
        raise ValueError(f"{len(problem.bodies)} bodies: expected one")
    if problem.sources or problem.sinks:
        raise ValueError("sources or sinks: expected a body whose particles are the same always")
    if problem.clock.dt is None:
        raise ValueError("the time step is adaptive: expected a fixed dt")
    rows = []
    for frame in simulate(problem):
        if frame.state.step != frame.index:
            raise ValueError(f"frame {frame.index} is step {frame.state.step}: expected every = 1")
        body = frame.state.bodies[0]
        rows.append([restore_order(getattr(body.particles, name), body.id)[::every]
                     for name in kind._fields])
    return kind(*(np.array(field) for field in zip(*rows, strict=True)))
