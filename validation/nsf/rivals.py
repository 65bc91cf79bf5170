"""The simplest rivals of NSF's reduced runs, each with its error, CPU time and memory: training
runs (the nearest, and the linear interpolation of two), the full model on coarser grids with
tracers, and the full model with MLS-MPM, the fastest transfer, and longer steps.

Errors are those of NSF-eq11, over the same points and times; CPU times are of stepping alone.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from math import inf
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.monitor import Unstable
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.baselines import interpolation_weights
from mpm_ref.rom.study.errors import PositionErrors, Squares
from mpm_ref.rom.study.evaluate import level_of
from mpm_ref.rom.study.full_model import field_of, nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..common.position_errors import record_position_errors
from ..common.registry import experiment
from ..common.scenes import with_
from ..common.tracers import advected
from .errors import ORIGIN
from .longer import stretched
from .reduced_runs import fit_study
from .studies import ball, bread, cake, jelly, metal, sand, toothpaste

COARSER = (2, 3, 4)         # times the spacing of the reduced run's grid
FACTORS = (1.0, 1.5, 2.0, 3.0)      # of the scene's step, with MLS-MPM
TRAINING = ("nearest", "interpolated")
REPEATS = 3
REDUCED = {"drawn": False, "weighted": True}        # kinds of samples
COLUMNS = ("scene", "value", "rival", "origin", "centroid", "displacement")
STUDIES = {"jelly": jelly, "sand": sand, "bread": bread, "toothpaste": toothpaste, "metal": metal,
           "cake": cake, "ball": ball}
FEWER = {"sand": 4, "bread": 6, "toothpaste": 5, "metal": 5, "cake": 5}    # trainings at quick


class Rival(NamedTuple):
    """A way to the positions of test runs, with its errors and cost."""

    name: str
    errors: PositionErrors      # infinite where a run ended before its time
    cpu: float                  # of the steps of a run [s]; 0 of training runs, which are looked up
    bytes: int                  # of what it has to hold


class Source(NamedTuple):
    """A run that gives the positions of a test's points at some times."""

    name: str
    states: Callable        # () -> iterator of (t [s], state)
    place: Callable         # state -> x (n, d) [m]
    bytes: int


@experiment("nsf.rivals", title="NSF: reduced runs beside their simplest rivals",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 1800})
def rivals(run):
    """Compare all scenes' reduced runs, with the study's samples, with each of their rivals."""
    rows = []
    for name in run.progress(run.choose(quick=("jelly",), standard=tuple(STUDIES)), "scenes"):
        one = fit_study(study_of(run, name))
        factor = longest_step(one.study)
        sources = {value: sources_of(one, value, factor) for value in one.study.test}
        with one_thread():
            errors = {value: errors_of(one, value, own) for value, own in sources.items()}
            cpu = cpu_seconds(sources[one.study.test[0]], run.choose(quick=1, standard=REPEATS))
        rows += [(name, value, rival, *shares) for value, own in errors.items()
                 for rival, shares in own.items()]
        record_scene(run, name, one, [
            Rival(rival, mean_errors([own[rival] for own in errors.values()]),
                  cpu.get(rival, 0.0), size) for rival, size in sizes(one, sources).items()])
    run.table("runs", COLUMNS, rows)


def study_of(run, name):
    """Return the `NsfStudy` of a scene at a profile, at quick with one test."""
    if run.profile == "standard":
        return STUDIES[name](2)
    few = {"train": FEWER[name]} if name in FEWER else {}
    quick = STUDIES[name](3, **few)
    return quick._replace(test=quick.test[:1])


def sources_of(one, value, factor):
    """Return all `Source`s of a test of a `FittedStudy`, reduced runs first; factor: of the step
    with MLS-MPM.
    """
    return [*reduced_sources(one, value), *full_sources(one.study, value, factor)]


def reduced_sources(one, value):
    """Return the `Source`s of reduced runs, with each kind of samples."""
    fields, full = one.fields_of_run(value), nsf_full_model(one.study.run(value))
    size = sum(a.nbytes for a in (fields.X, fields.U, fields.tau.modes, fields.C.modes))
    points = np.arange(len(full.X))
    for name, weighted in REDUCED.items():
        sets = one.study.chosen(full, one.study.samples, 0, one.fields if weighted else None)
        plan = nsf_run(full, fields, FieldRunOptions(sets, inversion=one.inversion), one.rest)
        yield Source(name, lambda plan=plan: ((t, latent) for t, latent, *_ in plan.states()),
                     lambda latent: fields.place(points, latent.xhat), size)


def full_sources(study, value, factor):
    """Return the `Source`s of full-order runs: the scene's own, with MLS-MPM, at its step and
    `factor` times as long, and on coarser grids with tracers.
    """
    scene = study.run(value)
    yield full_source("full", stretched(scene, 1.0))
    for one in sorted({1.0, factor}):
        yield full_source(f"mls.x{one:g}", mls(stretched(scene, one)))
    X = nsf_full_model(scene).X
    for times in COARSER:
        coarse = build(study._replace(coarser=study.coarser * times).run(value))
        yield Source(f"coarse.{times}", lambda coarse=coarse: advected(coarse, X), lambda x: x,
                     particle_bytes(coarse) + 2 * X.nbytes)


def full_source(name, scene):
    """Return the `Source` of a full-order run, each step of which is a frame."""
    def states():
        for frame in simulate(build(scene)):
            yield frame.t, frame.state.bodies
    return Source(name, states, lambda bodies: field_of(bodies, "x"), particle_bytes(build(scene)))


def particle_bytes(problem):
    """Return the bytes of a problem's particles."""
    return sum(a.nbytes for body in problem.bodies for a in body.particles)


def errors_of(one, value, sources):
    """Return {name: `PositionErrors`} of all rivals of a test."""
    return {source.name: run_errors(source, one.tests[value]) for source in sources} | {
        "nearest": one.nearest_run_errors(value), "interpolated": interpolation_errors(one, value)}


def run_errors(source, test):
    """Return the `PositionErrors` of a `Source`, compared with the `Histories` of a test."""
    squares, last = Squares(test.X), test.x.shape[1] - 1
    try:
        for t, state in source.states():
            level = level_of(t / test.dt)
            if level and level <= last:
                squares.add(source.place(state), test.x[0, level])
    except (Unstable, *BREAKDOWNS):
        return PositionErrors(inf, inf, inf)
    errors = squares.errors
    return errors if np.isfinite(errors).all() else PositionErrors(inf, inf, inf)


def interpolation_errors(one, value):
    """Return the `PositionErrors` of the linear interpolation of two training runs."""
    weights = interpolation_weights(one.runs.mu, np.array([value]))
    squares = Squares(one.runs.X)
    for level, reference in enumerate(one.tests[value].x[0, 1:], 1):
        squares.add(sum(w * one.runs.x[k, level] for k, w in weights.items()), reference)
    return squares.errors


def cpu_seconds(sources, repeats):
    """Return {name: CPU seconds of the steps of a run}, medians of runs in turn."""
    times = [[cpu_of(source) for source in sources] for _ in range(repeats)]
    return dict(zip((source.name for source in sources), np.median(times, axis=0).tolist(),
                    strict=True))


def cpu_of(source):
    """Return the CPU seconds of the states of a run, as far as it goes."""
    states = source.states()
    start = process_time()
    with suppress(Unstable, *BREAKDOWNS):
        deque(states, maxlen=0)
    return process_time() - start


def sizes(one, sources):
    """Return {name: bytes} of all rivals; sources: those of each test."""
    held = one.runs.x[0].nbytes
    return {source.name: source.bytes for source in next(iter(sources.values()))} | {
        "nearest": held, "interpolated": 2 * held}


def mean_errors(errors):
    """Return the mean of several `PositionErrors`."""
    return PositionErrors(*np.mean(errors, axis=0))


def longest_step(study):
    """Return the longest of FACTORS with which MLS-MPM comes to the end of the first training run:
    tests have no part in the choice.
    """
    scene = study.run(study.train[0])
    return max(factor for factor in FACTORS if ends(mls(stretched(scene, factor))))


def ends(scene):
    """Return whether a full-order run comes to its end with finite positions."""
    try:
        *_, last = simulate(build(with_(scene, every=scene.steps)))
    except Unstable:
        return False
    return bool(np.isfinite(field_of(last.state.bodies, "x")).all())


def mls(scene):
    """Return the scene with MLS-MPM as its transfer."""
    return with_(scene, scheme=with_(scene.scheme, transfer="mls"))


def record_scene(run, name, one, rivals):
    """Record the mean errors, CPU time and bytes of each `Rival`, and by how much reduced runs beat
    the others.
    """
    for rival in rivals:
        cost = f"{rival.cpu:.3g} CPU s a run" if rival.cpu else "looked up"
        record_position_errors(run, f"nsf.rivals.{name}.{rival.name}", rival.errors, one.scale,
                               f"{cost}; {rival.bytes / 1e6:.3g} MB; mean of "
                               f"{len(one.tests)}; {ORIGIN}", comparator="info")
    by_name = {rival.name: rival for rival in rivals}
    for kind in REDUCED:
        record_beats(run, f"nsf.rivals.{name}.{kind}.beats", by_name[kind], by_name, one.scale)


def record_beats(run, target, reduced, rivals, scale):
    """Record how many times the error of each training rival exceeds that of reduced runs, and how
    many times the CPU time of the cheapest full-order run of no larger error does.
    """
    for name in TRAINING:
        run.record(f"{target}.{name}", rivals[name].errors.origin / reduced.errors.origin, unit="x",
                   comparator=">=", bound=1.0, scale=scale,
                   note="its error over that of the reduced runs, of the distance from the origin")
    cheapest = min((rival for rival in rivals.values()
                    if rival.name not in (*TRAINING, *REDUCED)
                    and rival.errors.origin <= reduced.errors.origin),
                   key=lambda rival: rival.cpu)
    run.record(f"{target}.full", cheapest.cpu / reduced.cpu, unit="x", comparator=">=", bound=1.0,
               scale=scale, note=f"CPU time of {cheapest.name}, the cheapest full-order run tried "
               "with at most the error of the reduced runs, over theirs")
