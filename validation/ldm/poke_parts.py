"""Where reduced runs of a poke go wrong: while the patch drives the body, or as it swings free.

A run from the start is off by both. One that begins when the patch lets go, from the map's state
that is nearest to the full run and with its velocity, is off by the free part alone.
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
from .references import bent, pod, references, share
from .studies import POKES
from .untrained_maps import DRIVEN, LAM_F

DIMENSIONS = (6, 12, 24, 48)        # of POD
CUBIC = 3
R = 6                               # of the paper (LDM-sec5.3)
COLUMNS = ("map", "r", "part", "origin", "centroid", "displacement")


class Parts(NamedTuple):
    """What is told apart: `Errors` of some runs, or the sums they are made of."""

    whole: object           # all time levels
    driven: object          # until the patch lets go
    free: object            # from then on, of runs that begin there as the full ones are


@experiment("ldm.poke-parts", title="LDM: pokes that are driven, and that swing free",
            profiles=("quick", "standard"), budget={"quick": 40, "standard": 400})
def by_part(run):
    """Errors on pokes, all points: whole, driven and free, by map."""
    tests, rows = references(POKES, run.choose(quick=1, standard=2)), []
    compared = run.choose(quick=maps()[:1], standard=maps())
    for name, make, rest, way in run.progress(compared, "maps"):
        for part, errors in parts(tests, make(), rest, way)._asdict().items():
            share(run, f"ldm.poke-parts.{name}.{part}", errors, tests.scale, comparator="info")
            rows.append((name, len(rest), part, *errors))
    run.table("errors", COLUMNS, rows)


def maps():
    """What is compared: name, function that gives the map, latent coordinates at rest, `Way`."""
    def linear(r):
        return f"pod-{r}", lambda: pod(POKES.name, r), np.zeros(r), ALL

    network = trained("poke")
    return (("network", lambda: network.field, network.rest, ALL), *map(linear, DIMENSIONS),
            ("cubic", lambda: bent(POKES.name, R, CUBIC, LAM_F, DRIVEN), np.zeros(R),
             ALL._replace(projection="nonlinear")))


def parts(tests, decoder, rest, way):
    """`Parts` of the reduced runs of `References` on a map."""
    sums = Parts(*(Squares(tests.X) for _ in Parts._fields))
    for one, x in zip(tests.cases, tests.x, strict=True):
        end = let_go(one)
        states = ldm_run(one, decoder, way, rest).states()
        started = [decoder.place(one.X, state.latent.xhat) for state in states]
        add(sums.whole, started, x)
        add(sums.driven, started[:end + 1], x[:end + 1])
        add(sums.free, swinging(one, decoder, rest, way, x), x[end:])
    return Parts(*(part.errors for part in sums))


def add(sums, states, x):
    """Add states (n, d) beside those of the full run x."""
    for at, reference in zip(states, x, strict=True):
        sums.add(at, reference)


def let_go(one):
    """Number of the step of a `Case` after which its patch, the only region that ever does, lets
    go. Raises ValueError where none or several do.
    """
    ends = [part.until for part in prescribed_regions(one.problem) if isfinite(part.until)]
    if len(ends) != 1:
        raise ValueError(f"{len(ends)} prescribed regions let go: expected one, that of a poke; "
                         "give it, and it alone, an `until`")
    return round(ends[0] / one.problem.clock.dt)


def swinging(one, decoder, rest, way, x):
    """Yield the positions (n, d) of a reduced run that begins as the patch lets go, from the full
    run's x (k + 1, n, d).
    """
    clock, first = one.problem.clock, let_go(one)
    start = initial(decoder, one.X, x[first], (x[first] - x[first - 1]) / clock.dt, rest)
    stepper, sampler = ldm_model(one, decoder, way), ldm_sampler(one, decoder, way, rest, 0)
    latent = start
    yield decoder.place(one.X, latent.xhat)
    for k in range(first, clock.steps):
        t = k * clock.dt
        latent, _ = stepper.step(latent, sampler(t, latent).points, t, clock.dt)
        yield decoder.place(one.X, latent.xhat)
