"""The two methods that a study may use, LDM and NSF: the parts in which they differ."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...scene import SceneError, build
from ...store.writer import StoredFields
from ..fields.numbered import numbered
from .dataset import load_histories, load_snapshots
from .display import FieldDisplay, bodies_display, map_display, resampled
from .evaluate import ReferenceRun, history_reference
from .full_model import ldm_full_model, nsf_full_model
from .monitor import field_monitor, map_monitor, sample_warnings
from .record import LDM_SERIES, NSF_SERIES, Recording
from .reduce import (
    compute_fields,
    compute_map,
    fields_misfit,
    fields_of_run,
    map_misfit,
    require_one_body,
    train_fields,
    train_map,
)
from .run import (
    FieldRunOptions,
    ldm_run,
    nsf_run,
    require_boundary_cells,
    require_material_points,
    require_own_points,
)
from .samples import (
    ENOUGH,
    chosen_samples,
    random_draw,
    require_enough_samples,
    require_prescribed_region,
)
from .tables import LDM, NSF


@dataclass(frozen=True)
class ReductionMethod:
    """A method of model reduction: the functions of a study that depend on it."""

    stored: tuple               # fields of particles in all frames of full-order runs
    free_fields: tuple          # of a body of the scene, which may differ from run to run
    parameters: str             # in words: what may be varied
    frame_spacing: Callable     # (scene, changes) -> steps from one stored state to the next
    full_model: Callable        # scene -> `FullModel`; raises ValueError
    require_options: Callable   # (study, full): raises ValueError for options that do not suit it
    load: Callable              # (study, folder, numbers) -> `Snapshots` or `Histories`
    compute: Callable           # (study, data) -> field of modes, latent coordinates, those at rest
    train: Callable             # (study, data, about, checkpoint, on_epoch, machine) -> `Model`
    misfit: Callable            # (field, data, xhat) -> `PositionErrors`
    field_of_run: Callable      # (field, full, mu) -> field in that run
    reduced_run: Callable       # (study, full, field, rest) -> `ReducedRun`; raises ValueError
    recording: Callable         # (study, full, field, model, facts, count) -> `Recording`
    reference: Callable         # (full, data, k) -> `ReferenceRun`: run k of the data
    point_names: Callable       # full -> names of all points, as the field takes them
    search_points: Callable     # full -> slice of the points that the search for states uses
    shown_fields: StoredFields        # of particles, in results files of reduced runs
    first_level: int            # the first time level whose error counts


# LDM.

def every_step(base, changes):
    """Return 1: all states are stored."""
    return 1


def require_ldm_options(study, full):
    """Raise ValueError for a map, or a quadrature, that a `FullModel` of several bodies has not,
    and for options that its shape, its regions or the quadrature do not have.
    """
    options = study.tables.run.options
    require_one_body(study)
    require_own_points(full, options)
    require_boundary_cells(full, options)
    require_material_points(options)
    require_prescribed_region(full, options)


def map_of_run(g, full, mu):
    """Return the map of a run of a `FullModel`, whose points are places at rest of a single body,
    and numbers of several.
    """
    return g if len(full.bodies) == 1 else numbered(g)


def ldm_reduced_run(study, full, g, rest):
    """Return LDM's `ReducedRun` as a study asks for it. Raises ValueError for samples that do not
    suffice, and a precision that the map has not.
    """
    table = study.tables.run
    run = ldm_run(full, g, table.options, rest, table.seed)
    random_draw(full, g, table.options)
    return run


def ldm_recording(study, full, g, model, facts, count):
    """Return the `Recording` of a run of LDM, at `count` points of the body's shape; None: at those
    of the study. Raises ValueError for a number of points of several bodies.
    """
    table, scene = study.tables.run, full.problem
    several = len(full.bodies) > 1
    if several and count is not None:
        raise ValueError(f"--points-out {count}: reduced runs of several bodies are shown at "
                         f"their own {len(full.X)} points; leave it out")
    run = ldm_reduced_run(study, full, g, model.rest)
    mu = list(facts["parameters"].values())
    shown = scene if count is None else build(resampled(study.scene(mu), count))
    display = (bodies_display(g, full, table.velocity) if several
               else map_display(g, shown.bodies[0], table.velocity))
    return Recording(run, map_monitor(full, g, model.xhat), display, shown, table, facts,
                     LDM_SERIES, LDM_METHOD.shown_fields)


# NSF.

def stored_spacing(base, changes):
    """Return the steps between stored states of a `Scene` with changes {path: value}; 1 without
    `every`. Raises SceneError for frames by `interval`, and for a spacing that does not divide the
    steps.
    """
    names = "every", "interval", "steps"
    given = {name: changes.get(name, getattr(base, name)) for name in names}
    if given["interval"] is not None:
        raise SceneError(f"interval = {given['interval']}: expected `every`, steps from one kept "
                         "state to the next, in the scene or in [set]")
    every, steps = 1 if given["every"] is None else given["every"], given["steps"]
    if every == 0:
        raise SceneError("every = 0: expected 1 or more steps from one kept state to the next")
    if isinstance(every, int) and isinstance(steps, int) and steps % every:
        raise SceneError(f"every = {every}: expected a divisor of steps = {steps}, so that the "
                         "states kept are as far apart as each other; change one of the two")
    return every


def nsf_reduced_run(study, full, fields, rest):
    """Return NSF's `ReducedRun` as a study asks for it. Raises ValueError as
    `samples.chosen_samples` does.
    """
    table = study.tables.run
    samples = chosen_samples(table, full.problem, fields)
    return nsf_run(full, fields, field_run_options(table, samples), rest)


def field_run_options(table, samples):
    """Return the `FieldRunOptions` of the [run] table of a study, with a `SampleSet`."""
    return FieldRunOptions((samples,), table.dt_factor, table.inversion, table.inversion_tolerance)


def nsf_recording(study, full, fields, model, facts, count):
    """Return the `Recording` of a run of NSF. Raises ValueError for a number of points."""
    if count is not None:
        raise ValueError(f"--points-out {count}: reduced runs with inferred stress are shown "
                         f"at their own {len(full.X)} points; leave it out")
    table, problem = study.tables.run, full.problem
    samples = chosen_samples(table, problem, fields)
    run = nsf_run(full, fields, field_run_options(table, samples), model.rest)
    clock = replace(problem.clock, dt=run.dt, steps=run.steps, every=1)
    monitor = field_monitor(fields, model.xhat, (problem.clock.every or 1) / table.dt_factor)
    return Recording(run, monitor, FieldDisplay(full, fields),
                     replace(problem, clock=clock), table, facts, NSF_SERIES,
                     NSF_METHOD.shown_fields, tuple(sample_warnings(fields, samples)))


LDM_METHOD = ReductionMethod(
    stored=("x", "F", "v"), free_fields=("material", "velocity"),
    parameters="gravity, a material, a motion or a velocity at the start",
    frame_spacing=every_step, full_model=ldm_full_model, require_options=require_ldm_options,
    load=load_snapshots, compute=compute_map, train=train_map, misfit=map_misfit,
    field_of_run=map_of_run, reduced_run=ldm_reduced_run, recording=ldm_recording,
    reference=lambda full, data, k: ReferenceRun(full.X, data.x[k], None),
    point_names=lambda full: full.map_points, search_points=lambda full: slice(None),
    shown_fields=StoredFields(), first_level=0)

NSF_METHOD = ReductionMethod(
    stored=("x", "C", "tau"), free_fields=("material", "velocity"),
    parameters="gravity, a material, a motion or a velocity at the start",
    frame_spacing=stored_spacing, full_model=nsf_full_model,
    require_options=lambda study, full: require_enough_samples(study.tables.run, full.X,
                                                               study.tables.reduced_model.r),
    load=load_histories, compute=compute_fields, train=train_fields, misfit=fields_misfit,
    field_of_run=fields_of_run, reduced_run=nsf_reduced_run, recording=nsf_recording,
    reference=lambda full, data, k: history_reference(data, k),
    point_names=lambda full: np.arange(len(full.X)),
    search_points=lambda full: slice(None, None, -(-len(full.X) // ENOUGH)),
    shown_fields=StoredFields(("x", "v", "C", "tau")), first_level=1)

METHODS = {LDM: LDM_METHOD, NSF: NSF_METHOD}
