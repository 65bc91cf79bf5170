"""Errors of reduced runs of a poke: while the patch drives the body, and as it swings freely.

A run from the start has both. One that begins when the patch lets go, from the map's state
that is nearest to the full run and with its velocity, has the errors of the free part alone.
"""

from math import isfinite
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.latent import initial
from mpm_ref.rom.study.errors import Squares
from mpm_ref.rom.study.full_model import prescribed_regions
from mpm_ref.rom.study.run import ldm_model, ldm_run
from mpm_ref.rom.study.samples import ldm_sampler

from ..common.registry import experiment
from .networks import trained
from .paired_runs import ALL
from .references import curved_map, pod, record_errors, references
from .studies import POKES
from .untrained_maps import DRIVEN, LAM_F

DIMENSIONS = (6, 12, 24, 48)        # of POD
CUBIC = 3
PARTS = "whole", "driven", "free"   # in records and the table: the fields of `Parts`
R = 6                               # of the paper (LDM-sec5.3)
COLUMNS = ("map", "r", "part", "origin", "centroid", "displacement")


class Parts(NamedTuple):
    """`PositionErrors` of some runs, or the sums they are made of, for each part of the runs."""

    total: object           # all time levels
    driven: object          # until the patch lets go
    swinging: object        # from then on, of runs that begin there as the full ones are


@experiment("ldm.poke-parts", title="LDM: pokes that are driven, and that swing free",
            profiles=("quick", "standard"), budget={"quick": 40, "standard": 400})
def by_part(run):
    """Errors on pokes, all points, by map: of whole runs, the driven part and the free one."""
    tests, rows = references(POKES, run.choose(quick=1, standard=2)), []
    chosen = run.choose(quick=maps()[:1], standard=maps())
    for name, make, rest, options in run.progress(chosen, "maps"):
        for part, errors in zip(PARTS, parts(tests, make(), rest, options), strict=True):
            record_errors(run, f"ldm.poke-parts.{name}.{part}", errors, tests.scale,
                          comparator="info")
            rows.append((name, len(rest), part, *errors))
    run.table("errors", COLUMNS, rows)


def maps():
    """Return (name, function that makes the map, latent coordinates at rest, `RunOptions`) of all
    maps.
    """
    def linear(r):
        return f"pod-{r}", lambda: pod(POKES.name, r), np.zeros(r), ALL

    network = trained("poke")
    return (("network", lambda: network.field, network.rest, ALL), *map(linear, DIMENSIONS),
            ("cubic", lambda: curved_map(POKES.name, R, CUBIC, LAM_F, DRIVEN), np.zeros(R),
             ALL._replace(projection="nonlinear")))


def parts(tests, g, rest, options):
    """Return the `Parts` of the reduced runs of `References` on a map g."""
    sums = Parts(*(Squares(tests.X) for _ in Parts._fields))
    for one, x in zip(tests.cases, tests.x, strict=True):
        end = release_step(one)
        states = ldm_run(one, g, options, rest).states()
        started = [g.place(one.X, state.latent.xhat) for state in states]
        add(sums.total, started, x)
        add(sums.driven, started[:end + 1], x[:end + 1])
        add(sums.swinging, swinging_states(one, g, rest, options, x), x[end:])
    return Parts(*(part.errors for part in sums))


def add(sums, states, x):
    """Add the errors of states (n, d) against those of the full run x."""
    for state, reference in zip(states, x, strict=True):
        sums.add(state, reference)


def release_step(one):
    """Return the number of the step of a `FullModel` after which its patch lets go. Raises
    ValueError unless exactly one region does.
    """
    ends = [part.until for part in prescribed_regions(one.problem) if isfinite(part.until)]
    if len(ends) != 1:
        raise ValueError(f"{len(ends)} prescribed regions let go: expected one, that of a poke; "
                         "give it, and it alone, an `until`")
    return round(ends[0] / one.problem.clock.dt)


def swinging_states(one, g, rest, options, x):
    """Yield the positions (n, d) of a reduced run that begins as the patch lets go, from the full
    run's x (k + 1, n, d).
    """
    clock, first = one.problem.clock, release_step(one)
    start = initial(g, one.X, x[first], (x[first] - x[first - 1]) / clock.dt, rest)
    stepper, sampler = ldm_model(one, g, options), ldm_sampler(one, g, options, rest, 0)
    latent = start
    yield g.place(one.X, latent.xhat)
    for k in range(first, clock.steps):
        t = k * clock.dt
        samples = sampler(t, latent)
        latent, _ = stepper.step(latent, samples.points, t, clock.dt, samples.weights)
        yield g.place(one.X, latent.xhat)
