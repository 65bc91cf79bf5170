"""Hydrostatic pressure in a column of weakly compressible water; see `columns`.

With tau = lam J (J - 1) the pressure is p = -tau/J = lam (1 - J). At rest it is that of the water
above a particle, which sits deeper than in incompressible water, since dx = J dX:

    p = rho0 g (H - X),     x = X - rho0 g (H X - X^2/2) / lam

H = 2 m, rho0 = 1000 kg/m^2; lam is such that sound has 10 times the speed sqrt(2 g H), as
weakly compressible codes take it: at the floor J = 1 - 1/200.
"""

import numpy as np

from mpm_ref.materials import Fluid

from ..common.registry import experiment
from .columns import Column, settled, stress_errors
from .convergence import order
from .mms import name

WATER = Column(Fluid(lam=1000.0 * 100.0 * 2.0 * 10.0 * 2.0), height=2.0, rho0=1000.0)
SCHEME = ("mls", 3, 2)


def place_error(column, state):
    """Largest error of a particle's height, relative to the sinking of the surface."""
    k = column.rho0 * column.g / column.law.lam
    exact = state.X - k * (column.height * state.X - 0.5 * state.X**2)
    return float(np.max(np.abs(state.x - exact))) / (0.5 * k * column.height**2)


@experiment("verification.hydrostatic", title="Column of weakly compressible water",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 15})
def hydrostatic(run):
    """Pressure and places of the particles, with and without a wall."""
    cells = run.choose(quick=(8, 16, 32), standard=(8, 16, 32, 64, 128))
    rows = []
    for wall in (False, True):
        states = [settled(WATER, SCHEME, n, wall) for n in run.progress(cells, f"wall: {wall}")]
        errors = [(stress_errors(WATER, s)[0], place_error(WATER, s)) for s in states]
        rows += [(wall, n, *e) for n, e in zip(cells, errors, strict=True)]
        record(run, wall, cells, errors)
    run.table("errors", ("wall", "cells", "pressure_error", "place_error"), rows)


def record(run, wall, cells, errors):
    """Orders of pressure and place."""
    sizes, held = [1.0 / n for n in cells], "wall" if wall else "symmetric"
    scale = f"{cells} cells over the height, {name(SCHEME)}"
    for k, what in enumerate(("pressure", "place")):
        p, last = order(sizes, [e[k] for e in errors]), errors[-1][k]
        run.record(f"verification.hydrostatic.{held}.{what}.order", p, paper=1.0 if wall else 2.0,
                   comparator="band", bound=(0.8, 1.3) if wall else (1.8, 2.3),
                   scale=f"{scale}; last error {last:.1e}",
                   note="the wall's first order, as in verification.compaction" if wall else "")
