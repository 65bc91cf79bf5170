"""Reduced runs with network stress outside of the training of their fields: other parameters, and
ten times the trained time; and the bound on latent coordinates that tells wrong runs.
"""

import numpy as np

from mpm_ref.core.grid import OutOfRange
from mpm_ref.monitor import Unstable
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.full_model import field_of, nsf_full_model
from mpm_ref.simulate import simulate
from mpm_ref.timestep import TooLarge

from ..common.registry import experiment
from ..common.scenes import with_
from .ldm_extrapolation import TIMES_TRAINED, rms_displacement
from .ldm_runs import BAD, TOLERABLE, record_silent
from .nsf_runs import ERRORS, MAX_OUTLYING, FieldBench, scenes, simulate_test
from .verdicts import trial_table

OUTSIDE = {         # trained: speeds 0.3 to 0.5, hardening coefficients 0 to 0.2
    "jelly": {"quick": (0.2, 0.7, 1.0), "standard": (0.1, 0.2, 0.25, 0.6, 0.7, 0.8, 0.9, 1.0)},
    "metal": {"quick": (0.5, 5.0), "standard": (0.25, 0.3, 0.4, 0.6, 1.0, 2.0, 5.0)}}
INSIDE = {"jelly": (0.33, 0.37, 0.43, 0.48), "metal": ()}      # besides the tests
BOUNDS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0)     # of `beyond`
RATES = ("bound", "false_alarms", "misses", "good", "bad")


@experiment("extremes.nsf.beyond", title="NSF: parameters outside the trained range",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 300})
def parameter_range(run):
    """Run inside and outside the range. A run is bad where its error is above BAD times the largest
    of the tests, and above TOLERABLE.
    """
    trials, stopped = [], []
    for name, tested in scenes(run):
        bench = FieldBench(name, tested)
        trials += [bench.trial_of(f"{value:g}", end, bench.count)
                   for value, end in zip(tested.study.test, bench.tests, strict=True)]
        inside = INSIDE[name][::run.choose(quick=2, standard=1)]
        for value in run.progress((*inside, *OUTSIDE[name][run.profile]), f"{name}, values"):
            test, message = simulate_test(tested.study, value)
            if message:
                stopped.append(f"{name} {value:g}")
                continue
            end = bench.end(value, bench.drawn(bench.count), test)
            trials.append(bench.trial_of(f"{value:g}", end, bench.count))
    record_errors(run, trials)
    record_false_alarms(run, trials)
    record_silent(run, "extremes.nsf.beyond", trials, ERRORS, "full-order runs that stopped: "
                  + (", ".join(stopped) or "none"))
    run.table("rates", RATES, rates(trials, BOUNDS))
    trial_table(run, trials)


def rates(trials, bounds):
    """Return rows of RATES: the shares of good runs with latent coordinates out of a bound, and of
    bad runs within it that did not stop.
    """
    good, bad = ([t for t in trials if t.is_bad == is_bad] for is_bad in (False, True))
    return [(bound, sum(not t.end.beyond <= bound for t in good) / max(len(good), 1),
             sum(t.end.beyond <= bound and not t.end.message for t in bad) / max(len(bad), 1),
             len(good), len(bad)) for bound in bounds]


def record_errors(run, trials):
    """Record the error of every run."""
    for t in trials:
        run.record(f"extremes.nsf.beyond.{t.model}.{t.what}", t.end.error, unit="%",
                   comparator="info", scale=f"{t.model}, {t.points} samples, {ERRORS}",
                   note=f"{t.kind}; of the tests at most {t.usual:.3g} %; distance of the latent "
                        f"coordinates over that of training runs {t.end.beyond:.3g}")


def record_false_alarms(run, trials):
    """Record the share of the good runs that the monitor flagged."""
    good = [t for t in trials if not t.is_bad]
    flagged = [t for t in good if t.end.flags]
    examples = (f"{t.model}, {t.what}: {t.end.flags}, {t.end.error:.3g} %" for t in flagged[:6])
    run.record("extremes.nsf.beyond.false_alarms", len(flagged) / max(len(good), 1),
               comparator="info", scale=f"{ERRORS}, {len(good)} runs that are not bad",
               note="; ".join((f"share flagged in any step; bad: above {BAD:g} times the largest "
                               f"error of the tests, and above {TOLERABLE:g} %", *examples)))


ROWS = 100          # of a run
COLUMNS = ("scene", "samples", "step", "beyond", "distance", "full_distance", "kinetic",
           "full_kinetic")
LABELS = {"distance": "rms displacement", "kinetic": "kinetic energy"}


@experiment("extremes.nsf.long", title="NSF: ten times the trained time",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 300})
def long_run(run):
    """Compare latent coordinates, displacement and kinetic energy with the full-order run."""
    rows = []
    for name, tested in scenes(run):
        bench, scene = FieldBench(name, tested), tested.study.run(tested.study.test[0])
        steps = TIMES_TRAINED * scene.steps
        long = with_(scene, steps=steps, every=max(1, steps // ROWS), interval=None)
        full, full_message = full_run(long)
        samples = bench.drawn(bench.count)
        reduced, message = reduced_run(bench, long, samples)
        record_end(run, name, (reduced, message), (full, full_message), scene.steps)
        rows += [(name, len(samples.points), step, beyond, far, full.get(step, (np.nan,) * 2)[0],
                  kinetic, full.get(step, (np.nan,) * 2)[1])
                 for step, (beyond, far, kinetic) in reduced.items() if step % long.every == 0]
    run.table("drift", COLUMNS, rows)


def full_run(scene):
    """Run the full order as far as it goes. Returns {step of a frame: (rms displacement [m],
    kinetic energy [J])}, and the sentence with which it stopped.
    """
    full, frames = nsf_full_model(scene), {}
    try:
        for frame in simulate(full.problem):
            x, v = (field_of(frame.state.bodies, name) for name in "xv")
            frames[frame.state.step] = rms_displacement(x, full.X), kinetic_energy(full.m, v)
    except (Unstable, TooLarge, OutOfRange) as stop:
        return frames, str(stop)
    return frames, ""


def reduced_run(bench, scene, samples):
    """Run a reduced model. Returns {step: (beyond, rms displacement [m], kinetic energy [J])}, and
    the sentence with which it broke down or ended early.
    """
    full, fields, steps = nsf_full_model(scene), bench.tested.fields_of_run(bench.value), {}
    every_point, last, dt = np.arange(len(full.X)), None, full.problem.clock.dt
    try:
        for step, state in enumerate(bench.states(full, fields, samples)):
            x = fields.place(every_point, state.latent.xhat)
            v = full.v if last is None else (x - last) / dt
            steps[step] = (bench.monitor.check(state).beyond, rms_displacement(x, full.X),
                           kinetic_energy(full.m, v))
            last = x
    except BREAKDOWNS as stop:
        return steps, " ".join(str(stop).split())
    early = len(steps) <= full.problem.clock.steps
    return steps, (f"ended, {MAX_OUTLYING:g} times as far off as any trained state" if early
                   else "")


def kinetic_energy(m, v):
    """Return the kinetic energy [J] of points of mass m (n,) with velocities v (n, d)."""
    return 0.5 * float(m @ np.sum(v**2, axis=1))


def record_end(run, name, reduced, full, trained_steps):
    """Record the last step of a run, -1 without a start, and its drift, from `reduced_run` and
    `full_run`.
    """
    (steps, message), (frames, full_message) = reduced, full
    target = f"extremes.nsf.long.{name}"
    scale = f"{name}, {TIMES_TRAINED} times {trained_steps} steps"
    run.record(f"{target}.steps", max(steps, default=-1), unit="steps", comparator="info",
               scale=scale,
               note=message or "finished; the full-order run " + (full_message or "too"))
    if steps:
        beyond = np.array([values[0] for values in steps.values()])
        record_latent_distance(run, target, beyond, scale, trained_steps)
    both = set(steps) & set(frames)
    if both:
        record_last_state(run, target, (steps, frames), scale, max(both))


def record_latent_distance(run, target, beyond, scale, trained_steps):
    """Record the distance of each step's latent coordinates from the trained ones."""
    outside = np.flatnonzero(~(beyond <= 1.0))
    run.record(f"{target}.beyond", beyond.max(), comparator="info", scale=scale,
               note="largest distance of the latent coordinates from the trained ones, over their "
                    f"gap; within the trained steps {beyond[:trained_steps + 1].max():.3g}; above "
                    "1 first " + (f"in step {outside[0]}" if len(outside) else "never"))


def record_last_state(run, target, runs, scale, last):
    """Record displacement and kinetic energy in the last step that both runs have."""
    steps, frames = runs
    for k, what, unit in ((0, "distance", "m"), (1, "kinetic", "J")):
        peak = max(values[k] for values in frames.values())
        run.record(f"{target}.{what}", steps[last][k + 1], unit=unit, comparator="info",
                   scale=scale, note=f"{LABELS[what]} in step {last}; the full-order run "
                   f"{frames[last][k]:.3g}, its peak {peak:.3g}")
