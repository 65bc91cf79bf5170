"""Time and memory of reduced runs with inferred stress, compared with our own full-order run on the
same threads (appendix C and Figure 18 of the paper).

The printed speed-ups count a step that is 1.5 times as long (NSF-X6): both are recorded, and where
the time of either goes. Fields are those of modes, of three training runs only: with twelve the
radial functions have four times as many centres, which these times leave out.
"""

import dataclasses
from collections import deque
from time import perf_counter

import numpy as np

from mpm_ref.explicit import deform_body
from mpm_ref.rom.step import ReducedStepper
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import nsf_model, nsf_start
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import with_
from .errors import MODES
from .reduced_runs import FASTER, fit_study
from .studies import cake, metal, sand

INFO = {"comparator": "info"}
REPEATS, WARM = 3, 3        # timings; steps before them
SAND_STEPS = 120            # of the sand, of which only bytes are recorded
STAGES = {"integration": "cloud", "inferred": "bodies", "moved": "on_grid",
          "inverted": "project"}        # columns of the table: methods of `ReducedStepper`
COLUMNS = ("scene", "samples", "inversion", "points", "full", "deform", *STAGES, "reduced")
STUDIES = {"metal": (metal, (30, 10)), "cake": (cake, (700, 100))}


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
    full, rows = full_steps(one.study, steps), []
    for count in counts:
        for inversion in ("nonlinear", "linear"):
            repeats = [reduced_steps(one, count, inversion, steps) for _ in range(REPEATS)]
            spent = {key: float(np.median([r[key] for r in repeats])) for key in repeats[0]}
            rows.append((name, count, inversion, spent["points"], *full,
                         *(spent[stage] for stage in STAGES), spent["reduced"]))
    record_times(run, name, one, rows, steps)
    record_bytes(run, name, one)
    return rows


def full_steps(study, steps):
    """Return the seconds of a full-order step, and of its update of deformation: singular values,
    return map and stress; medians.
    """
    scene = study.run(study.test[0])
    deque(simulate(nsf_full_model(with_(scene, steps=WARM, every=WARM, interval=None)).problem),
          maxlen=0)
    took, deform = [], []
    for _ in range(REPEATS):
        problem = nsf_full_model(with_(scene, steps=steps, every=steps, interval=None)).problem
        start = perf_counter()
        *_, last = simulate(problem)
        took.append((perf_counter() - start) / steps)
    dt = problem.clock.dt
    for _ in range(2 * REPEATS):
        start = perf_counter()
        for body in last.state.bodies:
            deform_body(body, dt)
        deform.append(perf_counter() - start)
    return float(np.median(took)), float(np.median(deform))


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
    (_, count, _, points, full, deform, *stages, reduced), n = rows[0], len(one.fields.X)
    note = f"{count} samples, Gauss-Newton; median of {REPEATS}"
    for target, value in ((f"nsf.appC.{name}.speedup_per_step", full / reduced),
                          (f"nsf.{name}.speedup", FASTER * full / reduced)):
        run.record(f"{target}.{MODES}", value, unit="x", scale=scale, note=note)
    for target, value in (("full", 100.0 * full), (f"reduced_mpm.{MODES}", 100.0 * stages[2]),
                          (f"network.{MODES}", 100.0 * (reduced - stages[2]))):
        run.record(f"nsf.appC.{name}.{target}", value, unit="s/100 frames", scale=scale,
                   note=f"{note}; printed: a graphics processor")
    for target, value in (("particle_share", points / n), ("runtime_share", stages[2] / full)):
        run.record(f"nsf.appC.{name}.{target}.{MODES}", 100.0 * value, unit="%", scale=scale,
                   note=note)
    run.record(f"nsf.speed.{name}.deform", 100.0 * deform / full, unit="%", scale=scale, **INFO,
               note="of the full-order step: singular values, return map and stress, which a "
                    "reduced run skips")
    for _, count, inversion, points, *_, reduced in rows:
        run.record(f"nsf.speed.{name}.{inversion}.{count}", full / reduced, unit="x", scale=scale,
                   note=f"at equal step; {count} samples, {points:.0f} integration points; "
                        f"{1e3 * reduced:.3g} ms a step beside {1e3 * full:.3g} ms", **INFO)


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
