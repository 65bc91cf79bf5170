"""Learned laws outside of their training: bodies that are thrown faster, strained at the start,
lighter or denser; other time steps; runs five times as long.

A learned return map corrects F once a step, by an amount that it learned at one length of step: in
shorter steps it corrects more often.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.energy import kinetic
from mpm_ref.monitor import volume_ratio
from mpm_ref.nclaw.bodies import copy_body
from mpm_ref.nclaw.strain_watch import strain_report
from mpm_ref.nclaw.study.compare import RunBroken, positions
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import threads_for, with_
from ..nclaw.tasks import SEEDS, velocity
from .nclaw_runs import CHOSEN, EVERY, LawSetup, law_trials, laws, record_silent, scene_for
from .verdicts import trial_table

THROWS = {"quick": (3.0,), "standard": (0.0, 0.5, 1.5, 2.0, 3.0)}      # times the trained velocity
STRETCHES = {"quick": (1.5,), "standard": (0.5, 0.8, 1.2, 1.5, 2.0)}   # along x
DENSITIES = {"quick": (5.0,), "standard": (0.2, 0.5, 2.0, 5.0)}         # times the trained one
BOUNDS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)                   # of `beyond`
RATES = ("laws", "error", "beyond", "bad", "misses", "good", "false_alarms")
RATED = 3.0, 5.0    # times the usual error


def thrown(scene, factor):
    """Return a scene whose body flies and spins `factor` times as fast."""
    v = scene.body[0].velocity
    faster = with_(v, linear=tuple(factor * a for a in v.linear),
                   angular=tuple(factor * a for a in v.angular))
    return with_(scene, body=(with_(scene.body[0], velocity=faster),))


def denser(scene, factor):
    """Return a scene whose body is `factor` times as dense."""
    body = scene.body[0]
    return with_(scene, body=(with_(body, density=factor * body.density),))


def strain_setups(run, law):
    """Return the `LawSetup`s of a law, its training run first."""
    scene = scene_for(run, law.environment)
    seeds = run.choose(quick=(), standard=SEEDS)
    return [LawSetup("as trained", scene),
            *(LawSetup(f"velocity {seed}", with_(velocity(law.environment, seed), every=EVERY))
              for seed in seeds),
            *(LawSetup(f"thrown {k:g} times as fast", thrown(scene, k))
              for k in THROWS[run.profile]),
            *(LawSetup(f"stretched {k:g} times", scene, np.diag([k, 1.0, 1.0]))
              for k in STRETCHES[run.profile])]


@experiment("extremes.nclaw.strain", title="NCLaw: laws at strains outside of training",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 500})
def strain(run):
    """Run other throws, and bodies that are stretched or pressed at the start."""
    trials = [t for law in laws(run) for t in law_trials(run, law, strain_setups(run, law))]
    record_silent(run, trials, "throws up to 3 times as fast, stretches of 0.5 to 2")
    record_farthest(run, trials)
    trial_table(run, trials)
    run.table("rates", RATES, rates(trials))


def record_farthest(run, trials):
    """Record each law's largest error, and its run farthest out of bounds that is not bad."""
    for name in dict.fromkeys(t.law for t in trials):
        runs = [t for t in trials if t.law == name]
        worst = max(runs, key=lambda t: t.end.error)
        run.record(f"{run.experiment.id}.{name}.worst", worst.end.error / worst.usual,
                   comparator="info", scale=f"{len(runs)} runs", note="largest error over the "
                   f"usual one, {worst.usual:.3g} m^2: {worst.what}")
        good = max((t for t in runs if not t.is_bad()), key=lambda t: t.end.beyond)
        run.record(f"{run.experiment.id}.{name}.farthest", good.end.beyond, comparator="info",
                   scale=f"{len(runs)} runs", note="largest distance out of bounds, in their "
                   f"width, of a run that is not bad: {good.what}")


def rates(trials):
    """Return rows of RATES: misses among bad runs and false alarms among the others, by the factor
    that makes a run bad and by the bound on `beyond`; for the laws of CHOSEN and for the others.
    """
    rows = []
    for group, is_chosen in (("chosen", True), ("other", False)):
        runs = [t for t in trials if (t.law in CHOSEN) == is_chosen]
        for factor in RATED:
            for bound in BOUNDS:
                flagged = [(t.is_bad(factor), t.end.beyond > bound) for t in runs]
                bad = sum(is_bad for is_bad, _ in flagged)
                rows.append((group, factor, bound, bad, flagged.count((True, False)),
                             len(flagged) - bad, flagged.count((False, True))))
    return rows


@experiment("extremes.nclaw.density", title="NCLaw: bodies of another density than in training",
            profiles=("quick", "standard"), budget={"quick": 12, "standard": 200})
def density(run):
    """Compare with true laws at the same density: a learned law gives stress, not acceleration."""
    trials = []
    for law in laws(run):
        scene = scene_for(run, law.environment)
        trials += law_trials(run, law, [LawSetup("as trained", scene), *(
            LawSetup(f"{k:g} times as dense", denser(scene, k)) for k in DENSITIES[run.profile])])
    record_silent(run, trials, "0.2 to 5 times the trained density")
    record_farthest(run, trials)
    trial_table(run, trials)


FACTORS = {"quick": (1.0, 4.0), "standard": (1.0, 0.25, 0.5, 2.0, 4.0)}     # trained first


def with_time_step(scene, factor):
    """Return a scene with time steps `factor` times as long, and frames at the same times."""
    return with_(scene, dt=factor * scene.dt, steps=round(scene.steps / factor),
                 every=round(EVERY / factor))


@experiment("extremes.nclaw.dt", title="NCLaw: time steps of other lengths than in training",
            profiles=("quick", "standard"), budget={"quick": 12, "standard": 300})
def time_step(run):
    """Run a quarter to four times the trained step, and true laws with the same one."""
    trials = {}
    for law in laws(run):
        scene, factors = scene_for(run, law.environment), FACTORS[run.profile]
        setups = [LawSetup(f"{k:g} dt", with_time_step(scene, k)) for k in factors]
        trials[law.name] = dict(zip(factors, law_trials(run, law, setups), strict=True))
    every = [t for by_factor in trials.values() for t in by_factor.values()]
    record_silent(run, every, "0.25 to 4 times the trained step", judged=False)
    for name, by_factor in trials.items():
        for factor, t in by_factor.items():
            run.record(f"extremes.nclaw.dt.{name}.{factor:g}", t.end.error, unit="m^2",
                       comparator="info", scale=f"{t.end.steps} steps, 1000 particles",
                       note=f"{t.end.error / t.usual:.3g} times that with the trained step; "
                            f"farthest out of the bounds of strains {t.end.beyond:.2g} widths "
                            + t.end.message)
    trial_table(run, every)


STEPS = {"quick": 500, "standard": 5000}
ROW_EVERY = 50      # steps between rows
TAIL = 5            # means are over the last fifth of a run
COMPARED = {"kinetic": "J", "volume": "1", "height": "m"}


class LongRunRow(NamedTuple):
    """A learned run and the true one at one time."""

    step: int
    error: float            # mean squared [m^2]
    kinetic: float          # [J]
    true_kinetic: float
    volume: float           # mean J
    true_volume: float
    height: float           # mean [m]
    true_height: float
    beyond: float           # distance of the farthest point out of bounds, in their width


@experiment("extremes.nclaw.long", title="NCLaw: runs of 5 000 steps",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 300})
def long_run(run):
    """Compare kinetic energy, volume and height of a body with those of the true one."""
    table = []
    for law in run.progress(laws(run), "laws"):
        rows, message = compare_long_run(law, scene_for(run, law.environment, every=ROW_EVERY,
                                                        steps=STEPS[run.profile]))
        table += [(law.name, *row) for row in rows]
        record_drift(run, law, rows, message)
    run.table("drift", ("law", *LongRunRow._fields), table)


def compare_long_run(law, scene):
    """Run a long run. Returns its `LongRunRow`s, and the sentence with which it stopped."""
    problem, reference = build(scene), build(scene)
    body, true = law.make(problem.bodies[0]), copy_body(reference.bodies[0])
    rows, message = [], ""
    with threads_for(problem.bodies):
        run = positions(problem, (body,))
        for k, x in enumerate(positions(reference, (true,))):
            try:
                learned = next(run)
            except RunBroken as end:
                message = str(end)
                break
            rows.append(long_run_row(k * scene.every, (body, true), (learned, x), law.bounds))
    return rows, message


def long_run_row(step, bodies, x, bounds):
    """Return the `LongRunRow` of the learned and the true body with positions x."""
    state = [(float(kinetic(body.particles).sum()), float(volume_ratio(body.particles).mean()),
              float(y[:, 1].mean())) for body, y in zip(bodies, x, strict=True)]
    pairs = [a for pair in zip(*state, strict=True) for a in pair]
    return LongRunRow(step, float(np.mean((x[0] - x[1]) ** 2)), *pairs,
                      strain_report(bodies[0], bounds).excess)


def record_drift(run, law, rows, message):
    """Record the length, errors and means of a long run."""
    name, tail = f"extremes.nclaw.long.{law.name}", rows[-max(len(rows) // TAIL, 1):]
    rule = {"scale": f"{STEPS[run.profile]} steps, 1000 particles"}
    run.record(f"{name}.steps", rows[-1].step, unit="steps", comparator="=",
               paper=STEPS[run.profile], note=message, **rule)
    rule["comparator"] = "info"
    farthest = max(row.beyond for row in rows)
    run.record(f"{name}.error", mean(rows, "error"), unit="m^2", note="of the last fifth "
               f"{mean(tail, 'error'):.3g} m^2; farthest out of the bounds of strains "
               f"{farthest:.2g} widths", **rule)
    for word, unit in COMPARED.items():
        run.record(f"{name}.{word}", mean(tail, word), unit=unit, note="mean of the last fifth; "
                   f"the true one's {mean(tail, f'true_{word}'):.4g}", **rule)


def mean(rows, name):
    """Return the mean of a field over rows."""
    return float(np.mean([getattr(row, name) for row in rows]))
