"""What each choice of a reduced run costs and gives: on the tower, and on the small cylinder."""

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
OWN = ("map", "r", "points", "longer", "cpu_run", "cpu_full", "origin", "centroid", "displacement",
       "pareto")


def knobs():
    """`RunOptions`s that differ from BASE in one choice, and those of all cheap choices."""
    single = [BASE._replace(**{name: value}) for name, values in CHOICES.items()
              for value in values]
    cheap = [FAST._replace(points=n) for n in (10, 25, 50, 100)]
    return [BASE, *single, BASE._replace(preimage_tolerance=1e-2, precision="single"), *cheap]


@experiment("trade.ldm.knobs", title="LDM: what each choice costs and gives, on the tower",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 1500})
def of_ways(run):
    """Error and CPU time of a step by every choice alone, and all cheap ones together."""
    size, model = run.choose(quick=34, standard=385), trained(NET)
    quick = [BASE, BASE._replace(preimage_tolerance=1e-2), FAST._replace(points=50)]
    chosen = run.choose(quick=quick, standard=knobs())
    scene = scene_of(size, TOWER.test[1])
    steps = run.choose(quick=4, standard=scene.steps)
    full, found = race(scene, (model.field, model.rest), chosen, steps)
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

    map: str                # "network" or "pod"
    r: int
    points: int | None
    longer: int             # times the trained step

    @property
    def at(self):
        """The map, and latent coordinates near the body at rest."""
        if self.map == "pod":
            return pod(GRAVITY.name, self.r), np.zeros(self.r)
        model = trained(f"gravity-r{self.r}")
        return model.field, model.rest

    def measured(self, tests):
        """Errors, and CPU seconds of the steps of a run."""
        way, longer = RunOptions(points=self.points), lengthened(tests, self.longer)
        return longer.run_errors(*self.at, way), steps_of(longer, self.at, way)


def steps_of(tests, at, way):
    """CPU seconds of the steps of a reduced run: so many times the median."""
    one, x = tests.cases[0], tests.x[0]
    return one.problem.clock.steps * time_alone(one, at, way, x).spent.cpu


def lengthened(tests, longer):
    """`References` with a time step so many times longer, and the same right answer."""
    scenes = (GRAVITY.scene(-one.problem.gravity[-1]) for one in tests.cases)
    cases = tuple(ldm_full_model(with_(scene, dt=longer * scene.dt, steps=scene.steps // longer))
                  for scene in scenes)
    return References(tests.study, cases, tuple(x[::longer] for x in tests.x), tests.total)


@experiment("trade.ldm.gravity", title="LDM: error and cost by map, samples and time step",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def of_maps(run):
    """Lagrangian quadrature, linear projection; beside the full model with the trained step."""
    dimensions = run.choose(quick=(4,), standard=(1, 2, 4, 7))
    points = run.choose(quick=(10, None), standard=(5, 10, 50, None))
    longer = run.choose(quick=(1, 3), standard=(1, 2, 3, 5, 6))
    maps = run.choose(quick=("network",), standard=("network", "pod"))
    tests = references(GRAVITY, run.choose(quick=1, standard=3))
    chosen = [ReducedSetting(name, r, n, k) for name in maps for r in dimensions for n in points
              for k in longer]
    full = full_run(GRAVITY.scene(*GRAVITY.mu[GRAVITY.test[0]]))
    measured = [one.measured(tests) for one in run.progress(chosen, "settings")]
    best = front([cpu for _, cpu in measured], [errors.origin for errors, _ in measured])
    rows = [(one.map, one.r, one.points or "all", one.longer, cpu, full, *errors, int(on))
            for one, (errors, cpu), on in zip(chosen, measured, best, strict=True)]
    run.table("settings", OWN, rows)
    for one, (errors, cpu), on in zip(chosen, measured, best, strict=True):
        if on:
            words = f"{one.map}-r{one.r}.{one.points or 'all'}.dt-{one.longer}"
            record_errors(run, f"trade.ldm.gravity.{words}", errors, tests.scale,
                          f"{cpu:.3g} CPU s a run, the full model {full:.3g}: nothing is better "
                          "and cheaper", comparator="info")


def full_run(scene):
    """CPU seconds of the steps of a full-order run: so many times the median."""
    full = SteppedFullRun(scene)
    for _ in range(scene.steps):
        full.step()
    return scene.steps * median(full.spent).cpu


@experiment("trade.ldm.density", title="LDM: how dense Eulerian quadrature must be",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 300})
def of_density(run):
    """Errors on torsion, linear projection, all points, by quadrature points of a cell per axis."""
    tests = references(TORSION, run.choose(quick=1, standard=None))
    model, rows = trained("torsion-0"), []
    dense = run.choose(quick=(2, 3), standard=(1, 2, 3, 4))
    kinds = run.choose(quick=("eulerian",), standard=("eulerian", "resampled"))
    chosen = [RunOptions("lagrangian"),
              *(RunOptions(quadrature, per_cell=k, preimage_tolerance=1e-2)
                for quadrature in kinds for k in dense)]
    for way in run.progress(chosen, "densities"):
        at = model.field, model.rest
        errors, cpu = tests.run_errors(*at, way), steps_of(tests, at, way)
        words = way.quadrature if way == chosen[0] else f"{way.quadrature}.{way.per_cell}"
        record_errors(run, f"trade.ldm.density.{words}", errors, tests.scale,
                      f"{cpu:.3g} CPU s a run", comparator="info")
        rows.append((way.quadrature, way.per_cell, cpu, *errors))
    run.table("densities", ("quadrature", "per_cell", "cpu_run", "origin", "centroid",
                            "displacement"), rows)
