"""Time and memory of reduced runs with inferred stress, compared with our own full-order runs on
the same threads (appendix C and Figure 18 of the paper).

Judged is the time beside the fastest transfer, of APIC and MLS-MPM, whose error on a training run
is at most the printed error of the scene. All runs are in turn, medians of repeats.

The printed speed-ups count a step that is 1.5 times as long (NSF-X6): both are recorded, and where
the time of either goes. Fields are those of modes, of three training runs only: with twelve the
radial functions have four times as many centres, which these times leave out.
"""

import dataclasses
from time import perf_counter
from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import deform_body
from mpm_ref.rom.step import ReducedStepper
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import nsf_model, nsf_start
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..common import targets
from ..common.registry import experiment
from ..common.rivals import TestRun, full_source, mls, run_errors, stretched
from ..common.scenes import with_
from .errors import MODES
from .reduced_runs import FASTER, fit_study
from .studies import cake, metal, sand

INFO = {"comparator": "info"}
REPEATS, WARM = 3, 3        # timings; steps before them
SAND_STEPS = 120            # of the sand, of which only bytes are recorded
STAGES = {"integration": "cloud", "inferred": "bodies", "moved": "on_grid",
          "inverted": "project"}        # columns of the table: methods of `ReducedStepper`
COLUMNS = ("scene", "samples", "inversion", "points", "full", "deform", *STAGES, "reduced",
           "mls", "baseline")
STUDIES = {"metal": (metal, (30, 10)), "cake": (cake, (700, 100))}
ASKED = {"metal": "nsf.metal.error.30", "cake": "nsf.cake.error"}   # printed [%]
OWN, MLS = "full", "mls"                # transfers: the scene's, and the fastest
TRANSFERS = {OWN: "the scene's own transfer", MLS: "MLS-MPM"}
KINDS = "nonlinear", "linear"           # of inversion


class FullTimes(NamedTuple):
    """Seconds of full-order steps, medians."""

    full: float             # with the scene's own transfer
    mls: float              # with MLS-MPM
    deform: float           # of the first, its update of deformation

    def baseline(self, error, asked):
        """Return the name of the fastest transfer, given the error of MLS-MPM and that asked."""
        return MLS if error <= asked and self.mls < self.full else OWN


class TimedStepper(ReducedStepper):
    """The reduced model, with the seconds of its stages."""

    def reset(self):
        """Set the seconds of all stages to zero."""
        self.spent = dict.fromkeys(STAGES, 0.0)

    def timed(self, stage, *given):
        """Return the result of a stage, and add its seconds."""
        start = perf_counter()
        result = getattr(super(), STAGES[stage])(*given)
        self.spent[stage] += perf_counter() - start
        return result

    def cloud(self, *given):
        """Find the quadrature points, timed."""
        return self.timed("integration", *given)

    def bodies(self, *given):
        """Evaluate the fields, timed."""
        return self.timed("inferred", *given)

    def on_grid(self, *given):
        """Make a step on the grid, timed."""
        return self.timed("moved", *given)

    def project(self, *given):
        """Project on latent coordinates, timed."""
        return self.timed("inverted", *given)


@experiment("nsf.speed", title="NSF: time beside the full-order run",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 600})
def speed(run):
    """Metal frame and cake: time of a step and where it goes; bytes held, by sand too."""
    steps, rows = run.choose(quick=20, standard=100), []
    for name, (study, counts) in run.progress(STUDIES.items(), "scenes"):
        small = study(run.choose(quick=3, standard=1), train=3)
        one = fit_study(small._replace(test=small.test[1:2]))
        rows += record_scene(run, name, one, counts, steps)
    column = sand(run.choose(quick=3, standard=1), train=3)
    record_bytes(run, "sand", fit_study(column._replace(test=column.test[:1], steps=SAND_STEPS)))
    run.table("times", COLUMNS, rows)


def record_scene(run, name, one, counts, steps):
    """Record times and bytes of a scene; return a row for each number of samples and inversion."""
    times, reduced = times_in_turn(one, [(n, kind) for n in counts for kind in KINDS], steps)
    error = mls_error(one)
    baseline = times.baseline(error, asked(name))
    rows = [(name, *way, spent["points"], times.full, times.deform,
             *(spent[stage] for stage in STAGES), spent["reduced"], times.mls, baseline)
            for way, spent in reduced.items()]
    record_times(run, name, one, rows, steps)
    record_baselines(run, name, one, rows[0], error)
    record_bytes(run, name, one)
    return rows


def times_in_turn(one, options, steps):
    """Return the `FullTimes`, and {(samples, inversion): what `reduced_steps` returns}: medians of
    runs of a `FittedStudy` in turn.
    """
    scene = one.study.run(one.study.test[0])
    full, reduced = [], []
    for scheme in (scene, mls(scene)):
        full_run(scheme, WARM)
    for _ in range(REPEATS):
        took, last = full_run(scene, steps)
        full.append((took, full_run(mls(scene), steps)[0], deform_seconds(last, scene.dt)))
        reduced.append([reduced_steps(one, *own, steps) for own in options])
    return (FullTimes(*np.median(full, axis=0).tolist()),
            {own: {key: float(np.median([r[key] for r in repeats])) for key in repeats[0]}
             for own, repeats in zip(options, zip(*reduced, strict=True), strict=True)})


def full_steps(study, steps):
    """Return the seconds of a full-order step, and of its update of deformation: singular values,
    return map and stress; medians.
    """
    scene = study.run(study.test[0])
    full_run(scene, WARM)
    found = []
    for _ in range(REPEATS):
        took, last = full_run(scene, steps)
        found.append((took, deform_seconds(last, scene.dt)))
    return tuple(np.median(found, axis=0).tolist())


def full_run(scene, steps):
    """Return the seconds of a step of a full-order run from the start, and its last frame."""
    problem = build(with_(scene, steps=steps, every=steps, interval=None))
    start = perf_counter()
    *_, last = simulate(problem)
    return (perf_counter() - start) / steps, last


def deform_seconds(frame, dt):
    """Return the median seconds of updates of deformation of all bodies."""
    took = []
    for _ in range(2):
        start = perf_counter()
        for body in frame.state.bodies:
            deform_body(body, dt)
        took.append(perf_counter() - start)
    return float(np.median(took))


def asked(name):
    """Return the printed error of a scene [%]."""
    return float(targets.load()[ASKED[name]].value)


def mls_error(one):
    """Return the error of MLS-MPM [%] on the first training run of a `FittedStudy`, beside the
    scene's own transfer: tests have no part in the choice.
    """
    runs, scene = one.runs, one.study.run(one.study.train[0])
    return run_errors(full_source(MLS, mls(stretched(scene, 1.0))),
                      TestRun(runs.X, runs.x[0], runs.dt, 1)).origin * 100.0


def reduced_steps(one, count, inversion, steps):
    """Return {"reduced": seconds of a reduced step, STAGE: seconds of it, "points": integration
    points}, means over steps.
    """
    value = one.study.test[0]
    scene, fields = nsf_full_model(one.study.run(value)), one.fields_of_run(value)
    problem, plain = scene.problem, nsf_model(scene, fields, inversion)
    stepper = TimedStepper(*(getattr(plain, option.name) for option in dataclasses.fields(plain)))
    samples = one.study.chosen(scene, count, 0)[0].points
    stepper.reset()
    latent, dt, points = nsf_start(scene, fields, one.rest), problem.clock.dt, []
    for k in range(WARM + steps):
        if k == WARM:
            stepper.reset()
            start = perf_counter()
        latent, report = stepper.step(latent, samples, k * dt, dt)
        points.append(report.points)
    took = {stage: spent / steps for stage, spent in stepper.spent.items()}
    return took | {"reduced": (perf_counter() - start) / steps, "points": float(np.mean(points))}


def record_times(run, name, one, rows, steps):
    """Record speed-ups, shares and times of a scene's rows; the printed ones are of the first."""
    scale = f"{len(one.fields.X)} particles, {steps} steps, the first of a run"
    first, n = dict(zip(COLUMNS, rows[0], strict=True)), len(one.fields.X)
    full, reduced, grid = first["full"], first["reduced"], first["moved"]
    best = first[first["baseline"]]
    timed = f"{first['samples']} samples, Gauss-Newton; median of {REPEATS} in turn"
    note = f"{timed}, over {TRANSFERS[first['baseline']]}"
    for target, value in ((f"nsf.appC.{name}.speedup_per_step", best / reduced),
                          (f"nsf.{name}.speedup", FASTER * best / reduced)):
        run.record(f"{target}.{MODES}", value, unit="x", scale=scale, note=note)
    for target, value in (("full", 100.0 * full), (f"reduced_mpm.{MODES}", 100.0 * grid),
                          (f"network.{MODES}", 100.0 * (reduced - grid))):
        run.record(f"nsf.appC.{name}.{target}", value, unit="s/100 frames", scale=scale,
                   note=f"{timed}; printed: a graphics processor")
    for target, value in (("particle_share", first["points"] / n), ("runtime_share", grid / best)):
        run.record(f"nsf.appC.{name}.{target}.{MODES}", 100.0 * value, unit="%", scale=scale,
                   note=note)
    run.record(f"nsf.speed.{name}.deform", 100.0 * first["deform"] / full, unit="%", scale=scale,
               **INFO, note="of the full-order step: singular values, return map and stress, which "
                              "a reduced run skips")
    for row in rows:
        count, inversion, points = row[1:4]
        reduced = dict(zip(COLUMNS, row, strict=True))["reduced"]
        run.record(f"nsf.speed.{name}.{inversion}.{count}", full / reduced, unit="x", scale=scale,
                   note=f"at equal step; {count} samples, {points:.0f} integration points; "
                        f"{1e3 * reduced:.3g} ms a step beside {1e3 * full:.3g} ms", **INFO)


def record_baselines(run, name, one, row, error):
    """Record the speed-up at equal step over each transfer, and the error that admits MLS-MPM."""
    times, scale = dict(zip(COLUMNS, row, strict=True)), f"{len(one.fields.X)} particles"
    for transfer, words in TRANSFERS.items():
        run.record(f"nsf.speed.{name}.over.{transfer}", times[transfer] / times["reduced"],
                   unit="x", scale=scale, **INFO, note=f"at equal step, over {words}")
    run.record(f"nsf.speed.{name}.mls_error", error, unit="%", scale=scale, **INFO,
               note="of MLS-MPM beside the scene's own transfer, on the first training run, of "
                    f"the distance from the origin; at most {asked(name)} % is asked for; "
                    f"judged is the speed-up over {TRANSFERS[times['baseline']]}")


def record_bytes(run, name, one):
    """Record the bytes of the fields, and of the particles of a full-order run; those printed are
    of programs on a graphics processor, whose parts are not given.
    """
    fields, problem = one.fields, nsf_full_model(one.study.run(one.study.test[0])).problem
    field_bytes = sum(a.nbytes for a in (fields.X, fields.U, fields.tau.modes, fields.C.modes))
    particle_bytes = sum(a.nbytes for body in problem.bodies for a in body.particles)
    scale = f"{len(fields.X)} particles"
    for word, target, value, note in (
            ("fields", f"mem_reduced.{MODES}", field_bytes, "positions and modes; of doubles"),
            ("particles", "mem_full", particle_bytes, "of a full-order run, without the grid")):
        run.record(f"nsf.speed.{name}.bytes.{word}", value, unit="B", note=note, scale=scale,
                   **INFO)
        run.record(f"nsf.{name}.{target}", value / 1e9, unit="GB", scale=scale,
                   note=f"{note}; printed: of a program on a graphics processor")
