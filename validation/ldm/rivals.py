"""LDM's reduced runs, on networks and on POD modes, beside their simplest rivals (see
`common.rivals`). The full model of the paper's scenes is PIC.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.rom.study.baselines import interpolation_weights
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions, ldm_run
from mpm_ref.scene import Poisson

from ..common import rivals
from ..common.registry import experiment
from ..common.rivals import PositionSource, TestRivals, TestRun, nbytes
from ..common.scenes import threads_for, with_
from .networks import trained
from .references import ORIGIN, pod
from .studies import GRAVITY, POKES, TORSION, TOWER
from .tower import FAST, PAPER

COARSER = (2, 3)
REPEATS = 3
SMALL = {"all": RunOptions(), "50": RunOptions(points=50)}


class Contest(NamedTuple):
    """A study whose tests are compared."""

    study: object           # `LdmStudy`
    net: str                # of `networks.nets`
    r: int
    options: dict           # {name: `RunOptions`} of reduced runs
    tests: int              # how many, evenly among the study's


CONTESTS = {
    "gravity": Contest(GRAVITY, "gravity-r4", 4, SMALL, 6),
    "torsion": Contest(TORSION, "torsion-0", 7, SMALL, 7),
    "poke": Contest(POKES, "poke", 6, SMALL, 2),
    "tower": Contest(TOWER, "tower", 6, {"25": PAPER._replace(points=25),
                                         "fast": FAST._replace(points=25)}, 2)}


@experiment("ldm.rivals", title="LDM: reduced runs beside their simplest rivals",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 900})
def compare_rivals(run):
    """Compare the reduced runs of all studies, on a network and on POD, with their rivals."""
    rows = []
    for name in run.progress(run.choose(quick=("gravity",), standard=tuple(CONTESTS)), "studies"):
        contest = CONTESTS[name]._replace(tests=run.choose(quick=1, standard=CONTESTS[name].tests))
        study, count = contest.study, contest.tests
        factor = rivals.longest_step(study.scene(*study.mu[study.train[0]]))
        with one_thread():
            tests = {k: rivals_of(contest, k, factor) for k in study.test[::-(-len(study.test)
                                                                             // count)]}
            found = rivals.compare(tests, run.choose(quick=1, standard=REPEATS))
        rivals.record_rivals(run, f"ldm.rivals.{name}", found, reduced_names(contest),
                             scale_of(contest, tests), ORIGIN)
        rows += rivals.rows_of(name, found.errors)
    run.table("runs", rivals.COLUMNS, rows)


def reduced_names(contest):
    """Return the names of a contest's reduced runs."""
    return tuple(f"{model}.{name}" for model in ("network", "pod") for name in contest.options)


def scale_of(contest, tests):
    """Describe the size of the runs in words."""
    first = next(iter(tests.values())).test
    return (f"{len(first.X)} particles, {len(first.x) - 1} steps, {len(tests)} of "
            f"{len(contest.study.test)} test runs")


def rivals_of(contest, number, factor):
    """Return the `TestRivals` of a test run; factor: of the longer step with MLS-MPM."""
    study = contest.study
    scene, train = study.scene(*study.mu[number]), list(study.train)
    weights = interpolation_weights(study.mu[train], study.mu[number])
    near = int(np.argmin(np.linalg.norm((study.mu[train] - study.mu[number])
                                        / span_of(study.mu[train]), axis=1)))
    runs = {k: positions(study, train[k]) for k in {near, *weights}}
    test = TestRun(ldm_full_model(scene).X, positions(study, number), scene.dt, 0)
    looked_up = {rivals.NEAREST: runs[near]}
    if weights:
        looked_up[rivals.INTERPOLATED] = rivals.weighted_sum(weights, runs)
    sources = [*reduced_sources(contest, number),
               rivals.full_source("full", rivals.stretched(scene, 1)),
               *rivals.mls_sources(scene, factor),
               *rivals.coarse_sources({times: coarser(scene, times) for times in COARSER}, test.X)]
    return TestRivals(test, sources, looked_up)


def span_of(mu):
    """Return the range of each parameter of mu (runs, parameters); 1 of one that does not vary."""
    span = np.ptp(mu, axis=0)
    return np.where(span > 0.0, span, 1.0)


def positions(study, number):
    """Return x (k + 1, n, d) of all points of a full-order run."""
    return study._replace(every=1).run((number,)).x[0]


def coarser(scene, times):
    """Return the scene with dx and dt `times` as large, and as many particles in a cell."""
    body = scene.body[0]
    if isinstance(body.sampling, Poisson):
        count = round(body.sampling.count / times**scene.dim)
        body = with_(body, sampling=with_(body.sampling, count=count))
    return with_(scene, dx=scene.dx * times, dt=scene.dt * times, steps=scene.steps // times,
                 body=(body,), unstable="allow")


def reduced_sources(contest, number):
    """Yield the `PositionSource`s of reduced runs on the trained network, and on as many POD
    modes.
    """
    study, full = contest.study, ldm_full_model(contest.study.scene(*contest.study.mu[number]))
    model = trained(contest.net)
    maps = {"network": (model.field, model.rest),
            "pod": (pod(study.name, contest.r), np.zeros(contest.r))}
    for kind, (g, rest) in maps.items():
        for name, options in contest.options.items():
            if kind == "pod":
                options = options._replace(precision="double")
            yield PositionSource(f"{kind}.{name}", partial(reduced_states, full, g, options, rest),
                                 partial(positions_on, g, full.X), nbytes(g))


def reduced_states(full, g, options, rest):
    """Yield (t, latent coordinates) of a reduced run."""
    with threads_for(full.problem.bodies):
        for state in ldm_run(full, g, options, rest).states():
            yield state.t, state.latent.xhat


def positions_on(g, X, xhat):
    """Return the positions of points X on a map."""
    return g.place(X, xhat)
