"""Reduced runs outside of the training of their map: other parameters, longer time steps, another
body or load, and ten times the trained time. Pokes in a row are `ldm.table6`.
"""

from functools import cache

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.energy import energy
from mpm_ref.explicit import initial_stress
from mpm_ref.materials import NoFlow
from mpm_ref.rom.kinematics import evaluate
from mpm_ref.rom.latent import velocities
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import SCHEMES, RunOptions

from ..common.registry import experiment
from ..common.scenes import with_
from ..ldm.studies import GRAVITY, POKES, STUDIES, TORSION
from .ldm_runs import ReducedTrial, full_positions, record_silent, reduced_end, trained_reduction
from .verdicts import FINE, FLAGGED, STOPPED, trial_table

OUTSIDE = {         # parameters by study; trained 1 .. 10, and 0 .. 0.6, 0 .. 2
    "gravity": {"quick": (-5.0, 15.0, 30.0), "standard": (-10.0, -5.0, -1.0, 0.0, 0.5, 11.0, 12.0,
                                                          15.0, 20.0, 30.0, 50.0)},
    "torsion": {"quick": ((0.0, 10.0),),
                "standard": ((0.0, 3.0), (0.0, 10.0), (0.0, -1.0), (0.6, 3.0), (0.6, 5.0),
                             (0.8, 2.0), (1.0, 0.0), (2.0, 0.0), (1.2, 4.0), (-0.3, 0.0))}}
CHOSEN = {"quick": ("gravity-r4", "torsion-0"),         # maps that set the monitor's bounds
          "standard": ("gravity-r4", "gravity-r7", "torsion-0")}
LINEAR = SCHEMES[1:2]   # the cheapest scheme
OTHER = {"quick": (), "standard": ("gravity-r3", "gravity-r6", "torsion-1")}
FEW = {"gravity": 10, "torsion": 20}    # samples, besides all: half of them at the clamped ends


@cache
def full_order_run(study, mu):
    """Return the full model of a study by name, its positions x, and its sentence if it stopped."""
    full = ldm_full_model(STUDIES[study].scene(*mu))
    return full, *full_positions(full.problem)


@experiment("extremes.ldm.range", title="LDM: parameters outside the trained range",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def parameters(run):
    """Measure errors and flags by parameter; runs within the range must not be flagged."""
    chosen, other = CHOSEN[run.profile], OTHER[run.profile]
    by_map = {name: map_trials(run, name, name in other)
              for name in run.progress((*chosen, *other), "maps")}
    trial_table(run, [t for groups in by_map.values() for trials in groups for t in trials])
    record_rates(run, "extremes.ldm.range", [by_map[name] for name in chosen])
    if other:
        record_rates(run, "extremes.ldm.range.other_maps", [by_map[name] for name in other])


def map_trials(run, name, is_other):
    """Return a map's `ReducedTrial`s within the range, and those outside."""
    study = GRAVITY if name.startswith("gravity") else TORSION
    tests = [tuple(study.mu[k]) for k in study.test[::run.choose(quick=5, standard=1)]]
    far = [mu if isinstance(mu, tuple) else (mu,) for mu in OUTSIDE[study.name][run.profile]]
    schemes = LINEAR if is_other else run.choose(quick=LINEAR, standard=(*SCHEMES[:2], SCHEMES[3]))
    inside = [t for scheme in schemes for t in parameter_trials(name, study, tests, scheme)]
    usual = max(t.end.error for t in inside if t.points != FEW[study.name])
    return [[t._replace(usual=usual) for t in trials]
            for trials in (inside, parameter_trials(name, study, far, *LINEAR))]


def parameter_trials(name, study, values, scheme):
    """Return a map's `ReducedTrial`s over parameters, with all samples and with few."""
    trials, reduction = [], trained_reduction(name)
    for mu in values:
        full, x, message = full_order_run(study.name, mu)
        for points in (None, FEW[study.name]):
            options = RunOptions(*scheme, points)
            what = ", ".join(f"{a:g}" for a in mu) + (" (full order stopped)" if message else "")
            trials.append(ReducedTrial(name, what, options.name, points or len(full.X), np.nan,
                                       reduced_end(full, x, reduction, options)))
    return trials


def record_rates(run, name, by_map):
    """Record the errors of the monitor in maps' runs, (inside, outside) of each, and the extremes
    of its checks within the range.
    """
    inside, outside = ([t for groups in by_map for t in groups[k]] for k in (0, 1))
    flagged = [t for t in inside if t.end.flags]
    scale = f"{len(inside)} runs within the range, with all samples and with 10 or 20"
    examples = (f"{t.model}, {t.what}, {t.scheme} with {t.points}: {t.end.flags}"
                for t in flagged[:6])
    run.record(f"{name}.false_alarms", len(flagged) / len(inside), comparator="<=", bound=0.05,
               scale=scale, note="; ".join(("share flagged in any step", *examples)))
    for field, pick in (("beyond", max), ("off", max), ("coverage", min), ("lost", max)):
        worst = pick(inside, key=lambda t, field=field: getattr(t.end, field))
        run.record(f"{name}.inside.{field}", getattr(worst.end, field), comparator="info",
                   scale=scale, note=f"{pick.__name__}imum: {worst.model}, {worst.what}, "
                                     f"{worst.scheme} with {worst.points} samples")
    stopped = {t.what for t in outside if "stopped" in t.what}
    record_silent(run, name, inside + outside, "gravity up to 50 m/s^2, torsion up to 2 m/s and "
                  "10 rad/s", f"full-order runs that stopped: {len(stopped)}")


FACTORS = (1, 2, 3, 5, 6, 10)       # divisors of the 30 steps


@experiment("extremes.ldm.dt", title="LDM: time steps up to ten times the trained one",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 130})
def time_step(run):
    """Measure errors against the full-order run with the trained step."""
    names = run.choose(quick=("gravity-r4", "gravity-r7"),
                       standard=tuple(f"gravity-r{r}" for r in (1, 2, 4, 7)))
    choices = [RunOptions(*scheme, points)
               for scheme in run.choose(quick=SCHEMES[1:2], standard=SCHEMES[:2])
               for points in (None, 50)]
    trials, full_finished = [], {}
    for g in run.choose(quick=(GRAVITY.mu[21, 0],), standard=GRAVITY.mu[(2, 21), 0]):
        scene, (_, x, _) = GRAVITY.scene(g), full_order_run("gravity", (g,))
        for factor in run.progress(FACTORS, f"g = {g:.3g}"):
            longer = ldm_full_model(with_(scene, dt=factor * scene.dt, steps=scene.steps // factor))
            full_finished[g, factor] = not full_positions(longer.problem)[1]
            for name in names:
                what = f"{g:.3g} m/s^2, {factor} dt"
                trials += [(factor, time_step_trial(name, what, options, longer, x[::factor]))
                           for options in choices]
    trials = with_usual_errors(trials)
    record_silent(run, "extremes.ldm.dt", [t for _, t in trials], f"dt to {FACTORS[-1]} times")
    record_largest_steps(run, trials, full_finished)
    trial_table(run, [t for _, t in trials])


def time_step_trial(name, what, options, longer, x):
    """Return the `ReducedTrial` of a map with a longer step, against x at its time levels."""
    return ReducedTrial(name, what, options.name, options.points or len(longer.X), 0.0,
                        reduced_end(longer, x, trained_reduction(name), options))


def with_usual_errors(trials):
    """Return (factor, `ReducedTrial`); the usual error is a map's largest at the trained step."""
    return [(factor, t._replace(usual=max(u.end.error for k, u in trials
                                          if k == 1 and u.model == t.model)))
            for factor, t in trials]


def record_largest_steps(run, trials, full_finished):
    """Record up to which factor reduced runs are fine or finish, and full-order runs finish."""
    fine = [factor for factor, t in trials
            if all(u.kind == FINE for k, u in trials if k <= factor and u.model == t.model)]
    finished = [factor for factor, _ in trials
                if all(not u.end.message for k, u in trials if k <= factor)]
    full = [factor for _, factor in full_finished
            if all(ok for (_, k), ok in full_finished.items() if k <= factor)]
    run.record("extremes.ldm.dt.fine", max(fine, default=0), comparator=">=", bound=1.0,
               scale=f"{len(trials)} runs", note="times the trained step, up to which all runs of "
               "some map are fine")
    run.record("extremes.ldm.dt.going", max(finished, default=0), comparator=">=",
               bound=float(max(full)), scale=f"{len(trials)} runs", note="times the trained step, "
               f"up to which all runs finish; the full-order runs do up to {max(full)}")


TRAINED_ON = {"gravity-r4": "gravity", "gravity-r7": "gravity", "torsion-0": "torsion",
              "poke": "poke"}
QUICK = ("gravity-r4", "poke")
STEPS, SAMPLES = 30, 50


@experiment("extremes.ldm.mismatch", title="LDM: maps of another body or load",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 15})
def mismatch(run):
    """Check that the monitor notices a map on another body or load, where no file name, study or
    checksum prevents it. A map on its own body has the usual error.
    """
    full_runs, trials = {}, []
    for study, k in ((GRAVITY, 21), (TORSION, 20), (POKES, 1)):
        full = ldm_full_model(with_(study.scene(*study.mu[k]), steps=STEPS))
        full_runs[study.name] = full, full_positions(full.problem)[0]
    for name in run.progress(run.choose(quick=QUICK, standard=tuple(TRAINED_ON)), "maps"):
        trained_on = TRAINED_ON[name]
        ends = {study: reduced_end(*full_run, trained_reduction(name), RunOptions(points=SAMPLES))
                for study, full_run in full_runs.items()}
        trials += [ReducedTrial(name, f"on {study}", RunOptions().name, SAMPLES,
                                ends[trained_on].error, end)
                   for study, end in ends.items() if study != trained_on]
    missed = [f"{t.model} {t.what}: {t.end.error:.3g} %" for t in trials
              if t.kind not in (FLAGGED, STOPPED)]
    scale = f"first {STEPS} steps, {SAMPLES} samples"
    run.record("extremes.ldm.mismatch.noticed", 1.0 - len(missed) / len(trials), paper=1.0,
               comparator="=", scale=f"{scale}, {len(trials)} runs",
               note="; ".join(("share flagged or stopped", *missed)))
    record_silent(run, "extremes.ldm.mismatch", trials, scale)
    trial_table(run, trials)


TIMES_TRAINED = 10
FEW_SAMPLES = RunOptions(points=50)
EVERY = 5           # steps between rows
TAIL = 3            # displacements are compared over the last third of a run
FALLS = {"quick": ((1.0, ("gravity-r4",)),),        # [m/s^2], maps; at 10 the body itself tears
         "standard": tuple((g, ("gravity-r2", "gravity-r4", "gravity-r7"))
                           for g in (1.0, 2.0, 4.0, 10.0))}


@experiment("extremes.ldm.long", title="LDM: ten times the trained time",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 100})
def long_run(run):
    """Measure the drift from the full-order run, and energy, which nothing adds."""
    runs, table = [], []
    for g, names in run.progress(FALLS[run.profile], "gravity"):
        runs += [LongReducedRun(name, GRAVITY.scene(g), f"{g:g} m/s^2", FEW_SAMPLES)
                 for name in names]
    trials = [one.trial for one in runs]
    stopped = sum(bool(one.full_message) for one in runs)
    record_silent(run, "extremes.ldm.long", trials, f"{TIMES_TRAINED} times the trained steps",
                  f"full-order runs that stopped: {stopped}")
    record_drift(run, runs)
    for one in runs:
        table += [(one.trial.model, one.trial.what, one.trial.points, *row) for row in one.rows]
    trial_table(run, trials)
    run.table("drift", ("model", "what", "points", "step", "distance", "full", "energy"), table)


class LongReducedRun:
    """A long run: its `ReducedTrial`, and rows (step, rms displacement, that of the full-order run
    [m], energy above the initial one [J]). The usual error is that over the trained steps.
    """

    def __init__(self, name, scene, what, options):
        reduction = trained_reduction(name)
        full = ldm_full_model(with_(scene, steps=TIMES_TRAINED * scene.steps))
        x, self.full_message = full_positions(full.problem)
        usual = reduced_end(ldm_full_model(scene), x[:scene.steps + 1], reduction, options).error
        states = []
        end = reduced_end(full, x, reduction, options, states_out=states)
        what += " (full order stopped)" if self.full_message else ""
        self.trial = ReducedTrial(name, what, options.name, options.points or len(full.X), usual,
                                  end)
        shown = range(0, len(states), EVERY)
        full_distance = [rms_displacement(x[k], full.X) if k < len(x) else np.nan for k in shown]
        E = energies(full, reduction.field, options, [states[k][0] for k in shown])
        self.rows = np.stack([shown, [rms_displacement(states[k][1], full.X) for k in shown],
                              full_distance, E - E[0]], axis=1)

    @property
    def end(self):
        """Mean rms displacement in the last third, over that of the full-order run."""
        tail = self.rows[-(len(self.rows) // TAIL):]
        return tail[:, 1].mean() / tail[:, 2].mean()

    @property
    def gain(self):
        """Largest energy above the initial one, over the largest amount lost [1]."""
        return max(self.rows[:, 3].max(), 0.0) / max(-self.rows[:, 3].min(), 1e-300)


def rms_displacement(x, X):
    """Return the root mean square displacement [m]."""
    return float(np.sqrt(np.mean(np.sum((x - X) ** 2, axis=1))))


def energies(full, field, options, latents):
    """Return the mechanical energy of each of the states of a reduced run [J]."""
    law, dt = full.problem.bodies[0].law, full.problem.clock.dt
    totals = []
    for latent in latents:
        kinematics = evaluate(field, full.X, latent.xhat)
        v = velocities(field, latent, dt, full.X)[options.velocity](kinematics)
        particles = particles_at(kinematics.x, v, full.m, full.V0, transfer="pic")
        body = Body("reduced", particles._replace(F=kinematics.F), law, NoFlow(),
                    np.arange(len(kinematics.x)))
        initial_stress(body)
        totals.append(energy((body,), full.problem.gravity).sum)
    return np.array(totals)


def record_drift(run, runs):
    """Record displacements and energies at the end."""
    compared = [one for one in runs if not one.full_message]
    for name, pick, bound in (("farthest", max, 2.0), ("nearest", min, 0.5)):
        worst = pick(compared, key=lambda one: one.end)
        run.record(f"extremes.ldm.long.{name}", worst.end, comparator="<=" if pick is max else ">=",
                   bound=bound, scale=f"{len(compared)} runs whose full-order runs finished",
                   note=f"mean displacement in the last third, over the full-order run's: "
                        f"{worst.trial.model}, {worst.trial.what}, {worst.trial.points} samples")
    worst = max(runs, key=lambda one: one.gain)
    run.record("extremes.ldm.long.energy", worst.gain, comparator="<=", bound=0.0,
               scale=f"{len(runs)} runs", note="largest energy above the initial one, over the "
               f"loss: nothing adds energy; {worst.trial.model}, {worst.trial.what}")
