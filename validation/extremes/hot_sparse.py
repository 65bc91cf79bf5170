"""Few particles for the grid: one in a cell, none beside it, dust; and nodes of hardly any mass."""

from ..common.registry import experiment
from .blocks import alone
from .hot_bodies import DX, FRAME, brick, elastic, gravity, shaken
from .hot_solve import METHODS, Setup, record_ends, solve, table_of

SLIVER = 1e-12          # of a cell: how far a particle reaches into the support of its last nodes
DECADES = 8.0           # of the masses of dust


def bodies(d, E, rng):
    """{name: bodies} that leave the grid ill-filled."""
    cells, law = {2: (12, 12), 3: (6, 6, 6)}[d], elastic(E)
    share = 10.0 ** -rng.uniform(0.0, DECADES, len(brick(cells, law).id))
    return {
        "one per cell": one(brick(cells, law, per=1)),
        "one in two cells": one(spread(brick(cells, law, per=1), 2.0)),
        "isolated": one(spread(brick(cells, law, per=1), 5.0)),
        "dust": one(weighed(brick(cells, law), share, 1.0)),
        "grains": one(weighed(brick(cells, law), share, share)),
        "flakes": one(weighed(brick(cells, law), 1.0, share)),
        "scattered dust": one(weighed(spread(brick(cells, law), 2.5), share, 1.0)),
        "sliver": (stretched(at_edge(d, law)),),
        "sliver on a block": (*shaken((brick(cells, law),)), at_edge(d, law, cells[0])),
    }


def one(body):
    """A single body, strained and in motion."""
    return shaken((body,))


def spread(body, factor):
    """The body with its particles moved apart."""
    body.particles.x[:] *= factor
    return body


def weighed(body, mass, volume):
    """The body with masses and volumes times these factors (N,)."""
    body.particles.m[:] *= mass
    body.particles.V0[:] *= volume
    return body


def at_edge(d, law, cells=3):
    """A particle whose last nodes have (SLIVER^2/2)^d of its mass, beside so many cells."""
    x = [(cells + 0.5 + SLIVER) * DX] + [(1.5 + SLIVER) * DX] * (d - 1)
    return alone(x, DX, law, "apic")._replace(name="sliver")


def stretched(body):
    """The body stretched by a tenth."""
    body.particles.F[:] *= 1.1
    return body


@experiment("extremes.hot.sparse", title="One particle per cell, isolated ones, dust, tiny nodes",
            profiles=("quick", "standard"), budget={"quick": 2, "standard": 25})
def sparse(run):
    """One step of 1/24 s of matter that hardly holds together on the grid."""
    rows = []
    for d in run.choose(quick=(2,), standard=(2, 3)):
        for E in run.choose(quick=(1e4, 1e9), standard=(1e2, 1e4, 1e6, 1e9, 1e12)):
            for name, made in run.progress(bodies(d, E, run.rng).items(), "bodies"):
                setup = Setup(made, DX, FRAME, gravity(d))
                rows += [(d, E, name, solve(setup, method)) for method in METHODS]
    record_ends(run, "sparse", [row[-1] for row in rows], "12 x 12 cells in 2D (3D: 6 x 6 x 6), "
                f"1 to 576 particles; masses over {DECADES:g} decades, nodal ones over 48")
    table_of(run, ("d", "E", "body"), rows)
