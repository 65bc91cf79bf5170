"""Error and cost of LDM's reduced runs by each option, on the tower and on the small cylinder."""

from dataclasses import dataclass

import numpy as np

from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions

from ..common.registry import experiment
from ..common.scenes import with_
from ..ldm.networks import trained
from ..ldm.references import References, pod, record_errors, references
from ..ldm.studies import GRAVITY, TORSION, TOWER
from ..ldm.timing import COLUMNS, SteppedFullRun, median, race, time_alone
from ..ldm.tower import FAST, NET, PAPER, scene_of
from .front import front

BASE = PAPER._replace(points=50)
CHOICES = {                 # one at a time, from BASE
    "points": (10, 25, 100, 200), "quadrature": ("lagrangian", "resampled"), "per_cell": (1, 3),
    "projection": ("nonlinear",), "velocity": ("transported", "difference", "latest"),
    "preimage_tolerance": (1e-4, 1e-2, 1e-1), "samples": ("kept", "pivoted")}
SETTING_COLUMNS = ("map", "r", "points", "longer", "cpu_run", "cpu_full", "origin", "centroid",
                   "displacement", "pareto")


def single_choices():
    """Return the `RunOptions` that differ from BASE in one choice, and all cheap ones together."""
    single = [BASE._replace(**{name: value}) for name, values in CHOICES.items()
              for value in values]
    cheap = [FAST._replace(points=n) for n in (10, 25, 50, 100)]
    return [BASE, *single, BASE._replace(preimage_tolerance=1e-2, precision="single"), *cheap]


@experiment("trade.ldm.knobs", title="LDM: error and cost of each option, on the tower",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 1500})
def options(run):
    """Measure error and CPU time of a step by every choice, and by all cheap ones together."""
    size, model = run.choose(quick=34, standard=385), trained(NET)
    quick = [BASE, BASE._replace(preimage_tolerance=1e-2), FAST._replace(points=50)]
    chosen = run.choose(quick=quick, standard=single_choices())
    scene = scene_of(size, TOWER.test[1])
    steps = run.choose(quick=4, standard=scene.steps)
    full, _, found = race(scene, (model.field, model.rest), chosen, steps)
    scale = f"about {size} thousand particles, {steps} steps, one test run"
    for one in found:
        record_errors(run, f"trade.ldm.knobs.{one.label}", one.errors, scale,
                      f"{1e3 * one.spent.cpu:.3g} ms of CPU time a step, the full model "
                      f"{1e3 * full.cpu:.3g}; {one.points} quadrature points", comparator="info")
    best = front([one.spent.cpu for one in found], [one.errors.origin for one in found])
    run.table("ways", (*COLUMNS, "cpu_full", "pareto"),
              [(*one.row, full.cpu, int(on)) for one, on in zip(found, best, strict=True)])


@dataclass(frozen=True)
class ReducedSetting:
    """A reduced run of the cylinder under gravity."""

    model: str              # "network" or "pod"
    r: int
    points: int | None
    longer: int             # time step over the trained one

    @property
    def map_at_rest(self):
        """The map, and latent coordinates near the body at rest."""
        if self.model == "pod":
            return pod(GRAVITY.name, self.r), np.zeros(self.r)
        model = trained(f"gravity-r{self.r}")
        return model.field, model.rest

    def measured(self, tests):
        """Return errors, and CPU seconds of the steps of a run."""
        options, longer = RunOptions(points=self.points), with_longer_steps(tests, self.longer)
        return (longer.run_errors(*self.map_at_rest, options),
                run_cpu(longer, self.map_at_rest, options))


def run_cpu(tests, map_at_rest, options):
    """Return the CPU seconds of the steps of a reduced run: their number times the median."""
    one, x = tests.cases[0], tests.x[0]
    return one.problem.clock.steps * time_alone(one, map_at_rest, options, x).spent.cpu


def with_longer_steps(tests, longer):
    """Return `References` with a time step `longer` times as long, and the same answer."""
    scenes = (GRAVITY.scene(-one.problem.gravity[-1]) for one in tests.cases)
    cases = tuple(ldm_full_model(with_(scene, dt=longer * scene.dt, steps=scene.steps // longer))
                  for scene in scenes)
    return References(tests.study, cases, tuple(x[::longer] for x in tests.x), tests.total)


@experiment("trade.ldm.gravity", title="LDM: error and cost by map, samples and time step",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def maps(run):
    """Compare reduced runs with Lagrangian quadrature and linear projection with the full model."""
    dimensions = run.choose(quick=(4,), standard=(1, 2, 4, 7))
    points = run.choose(quick=(10, None), standard=(5, 10, 50, None))
    longer = run.choose(quick=(1, 3), standard=(1, 2, 3, 5, 6))
    maps = run.choose(quick=("network",), standard=("network", "pod"))
    tests = references(GRAVITY, run.choose(quick=1, standard=3))
    chosen = [ReducedSetting(name, r, n, k) for name in maps for r in dimensions for n in points
              for k in longer]
    full = full_run_cpu(GRAVITY.scene(*GRAVITY.mu[GRAVITY.test[0]]))
    measured = [one.measured(tests) for one in run.progress(chosen, "settings")]
    best = front([cpu for _, cpu in measured], [errors.origin for errors, _ in measured])
    rows = [(one.model, one.r, one.points or "all", one.longer, cpu, full, *errors, int(on))
            for one, (errors, cpu), on in zip(chosen, measured, best, strict=True)]
    run.table("settings", SETTING_COLUMNS, rows)
    for one, (errors, cpu), on in zip(chosen, measured, best, strict=True):
        if on:
            words = f"{one.model}-r{one.r}.{one.points or 'all'}.dt-{one.longer}"
            record_errors(run, f"trade.ldm.gravity.{words}", errors, tests.scale,
                  f"{cpu:.3g} CPU s a run, the full model {full:.3g}: nothing is better and "
                  "cheaper", comparator="info")


def full_run_cpu(scene):
    """Return the CPU seconds of the steps of a full-order run: their number times the median."""
    full = SteppedFullRun(scene)
    for _ in range(scene.steps):
        full.step()
    return scene.steps * median(full.spent).cpu


@experiment("trade.ldm.density", title="LDM: density of Eulerian quadrature",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 300})
def quadrature_density(run):
    """Measure errors on torsion over the quadrature points of a cell per axis."""
    tests = references(TORSION, run.choose(quick=1, standard=None))
    model, rows = trained("torsion-0"), []
    dense = run.choose(quick=(2, 3), standard=(1, 2, 3, 4))
    kinds = run.choose(quick=("eulerian",), standard=("eulerian", "resampled"))
    chosen = [RunOptions("lagrangian"),
              *(RunOptions(quadrature, per_cell=k, preimage_tolerance=1e-2)
                for quadrature in kinds for k in dense)]
    for options in run.progress(chosen, "densities"):
        map_at_rest = model.field, model.rest
        errors, cpu = tests.run_errors(*map_at_rest, options), run_cpu(tests, map_at_rest, options)
        quadrature, per_cell = options.quadrature, options.per_cell
        words = quadrature if options == chosen[0] else f"{quadrature}.{per_cell}"
        record_errors(run, f"trade.ldm.density.{words}", errors, tests.scale,
                      f"{cpu:.3g} CPU s a run", comparator="info")
        rows.append((quadrature, per_cell, cpu, *errors))
    run.table("densities", ("quadrature", "per_cell", "cpu_run", "origin", "centroid",
                            "displacement"), rows)
