"""Young's modulus over ten decades, contrasts over eight in one body, and Poisson's ratio."""

from typing import NamedTuple

from mpm_ref.hot.methods import METHODS as ALL

from ..common.registry import experiment
from .hot_bodies import DX, FRAME, elastic, gravity, halves, shaken
from .hot_solve import METHODS, Setup, record_ends, solve, table_of

SOFT = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)
CONTRAST = (1.0, 1e2, 1e4, 1e6, 1e8)
STIFFEST = 1e12
SINGLE = ALL["hot"].cycle._replace(precision="single")
RATIOS = (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999)
CELLS = {2: (16, 8), 3: (8, 4, 4)}


class Pair(NamedTuple):
    """Moduli of the two halves of a box [Pa]."""

    d: int
    E: float
    contrast: float


def pairs(d, soft=SOFT, contrasts=CONTRAST):
    """All pairs whose stiffer half is within bounds."""
    return [Pair(d, E, c) for E in soft for c in contrasts if E * c <= STIFFEST]


def bent(d, laws, dt=FRAME):
    """`Setup` of a strained box of two laws in uneven motion."""
    return Setup(shaken(halves(CELLS[d], laws)), DX, dt, gravity(d))


@experiment("extremes.hot.stiffness", title="Moduli from 1e2 to 1e12 Pa, contrasts up to 1e8",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 12})
def stiffness(run):
    """A box with a soft and a stiff half, one step of 1/24 s, by all methods, and by HOT with the
    matrices of its smoothers in single precision.
    """
    cases = run.choose(quick=pairs(2) + pairs(3, (1e2, 1e4, 1e12), (1.0, 1e8)),
                       standard=pairs(2) + pairs(3))
    rows = []
    for case in run.progress(cases, "pairs"):
        setup = bent(case.d, (elastic(case.E), elastic(case.E * case.contrast)))
        rows += [(*case, solve(setup, method)) for method in METHODS]
        rows.append((*case, solve(setup, "hot", cycle=SINGLE)._replace(method="hot-single")))
    for d, cells in CELLS.items():
        record_ends(run, f"stiffness.{d}d", [end for k, *_, end in rows if k == d],
                    f"{d}D, {' x '.join(map(str, cells))} cells, {2**d} particles each")
    table_of(run, Pair._fields, rows)


@experiment("extremes.hot.poisson", title="Poisson's ratio up to 0.4999",
            profiles=("quick", "standard"), budget={"quick": 3, "standard": 10})
def poisson(run):
    """The same box of one material, nearly incompressible."""
    rows = []
    for d in (2, 3):
        for E in run.choose(quick=(1e6,), standard=(1e4, 1e6, 1e9)):
            for nu in RATIOS:
                setup = bent(d, (elastic(E, nu), elastic(E, nu)))
                rows += [(d, E, nu, solve(setup, method)) for method in METHODS]
    record_ends(run, "poisson", [row[-1] for row in rows], "2D and 3D boxes, 512 and 1024 "
                "particles, one step of 1/24 s")
    table_of(run, ("d", "E", "nu"), rows)
