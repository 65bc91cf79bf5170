"""Reduced runs of two elastic bodies in one velocity field: a stiff, heavy block that moves along a
soft one or falls on it. LDM is printed with one body.

Held-out runs on 4 and 16 POD modes of four training runs stand beside the nearest training run and
the linear interpolation between training runs. That errors of the displacement should be below
these was chosen before the first run.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.study.baselines import interpolation_weights
from mpm_ref.rom.study.full_model import field_of, ldm_full_model
from mpm_ref.rom.study.run import RunOptions
from mpm_ref.scene import build, loads
from mpm_ref.simulate import simulate

from ..common import rivals
from ..common.registry import experiment
from ..common.rivals import PositionSource, TestRivals, TestRun, nbytes
from .references import nearest_state_errors
from .rivals import positions_on, reduced_states

STEPS = 150
TRAIN = (0.5, 1.0, 1.5, 2.0)        # speeds of the upper block [m/s]
TEST = (1.3, 0.7, 1.8)              # held out, none halfway between two of training
SIZES = (4, 16)                     # modes
STARTS = {      # velocity [m/s] and lower side [m] of the upper block: on the other, or two cells
                # above it
    "along": ("[{speed}, 0.0]", 0.3), "falling": ("[0.0, -{speed}]", 0.5)}
TRANSFERS = ("pic", "apic")         # the paper's, and another
FULL = "full"
LOOKED_UP = {rivals.NEAREST: "the nearest training run",
             rivals.INTERPOLATED: "the interpolation of training runs"}
COLUMNS = ("start", "transfer", "test", "rival", "origin", "centroid", "displacement")
SCENE = """
title = "Two blocks"
dim = 2
dx = 0.1
dt = 0.002
steps = {steps}
every = 1
gravity = [0.0, -9.8]
scheme = {{ transfer = "{transfer}" }}

[[body]]
name = "soft"
density = 1000.0
shape = {{ type = "box", lower = [0.0, 0.0], upper = [0.8, 0.3] }}
sampling = {{ type = "regular", per_cell = 2 }}
material = {{ law = "fixed_corotated", E = 1.0e5, nu = 0.3 }}

[[body]]
name = "hard"
density = 3000.0
shape = {{ type = "box", lower = [0.1, {bottom}], upper = [0.7, {top}] }}
sampling = {{ type = "regular", per_cell = 2 }}
velocity = {{ linear = {velocity} }}
material = {{ law = "fixed_corotated", E = 1.0e6, nu = 0.2 }}

[[fixed]]
name = "floor"
region = {{ type = "half_space", point = [0.0, 0.05], normal = [0.0, 1.0] }}
"""


class FullRun(NamedTuple):
    """A full-order run, all bodies one after the other."""

    x: np.ndarray       # (k + 1, n, d) [m]
    F: np.ndarray       # (k + 1, n, d, d)


class BlockTraining(NamedTuple):
    """The training runs of a start and a transfer, and modes of them."""

    start: str          # of STARTS
    transfer: str
    runs: list          # `FullRun`s at the speeds TRAIN
    maps: dict          # {number of modes: `PodModes`}


def two_blocks(start, transfer, speed):
    """Return the scene of a start of STARTS with a speed of the upper block [m/s]."""
    velocity, bottom = STARTS[start]
    return loads(SCENE.format(steps=STEPS, transfer=transfer, bottom=bottom, top=bottom + 0.4,
                              velocity=velocity.format(speed=speed)))


def full_run(scene):
    """Return the `FullRun` of a scene, every step of which is a frame."""
    states = [(field_of(bodies, "x").copy(), field_of(bodies, "F").copy())
              for bodies in (frame.state.bodies for frame in simulate(build(scene)))]
    return FullRun(*map(np.stack, zip(*states, strict=True)))


def training(start, transfer):
    """Return the `BlockTraining` of a start and a transfer."""
    runs = [full_run(two_blocks(start, transfer, speed)) for speed in TRAIN]
    x, F = (np.concatenate(field) for field in zip(*runs, strict=True))
    X = ldm_full_model(two_blocks(start, transfer, TRAIN[0])).X
    return BlockTraining(start, transfer, runs, {r: modes(X, x, F, r) for r in SIZES})


def rivals_of(trained, speed):
    """Return the `TestRivals` of a speed: the full run, reduced runs by the names `modes.R` with
    all points as samples, and what training runs give.
    """
    scene = two_blocks(trained.start, trained.transfer, speed)
    full, mu = ldm_full_model(scene), np.array(TRAIN)[:, None]
    x = {k: one.x for k, one in enumerate(trained.runs)}
    reduced = [PositionSource(name_of(r), partial(reduced_states, full, g, RunOptions(),
                                                  np.zeros(r)),
                              partial(positions_on, g, full.X), nbytes(g))
               for r, g in trained.maps.items()]
    return TestRivals(
        TestRun(full.X, full_run(scene).x, scene.dt, 0),
        [rivals.full_source(FULL, scene), *reduced],
        {rivals.NEAREST: x[int(np.argmin(np.abs(np.array(TRAIN) - speed)))],
         rivals.INTERPOLATED: rivals.weighted_sum(
             interpolation_weights(mu, np.array([speed])), x)})


def name_of(r):
    """Return the name of the reduced run on r modes."""
    return f"modes.{r}"


@experiment("ldm.several-bodies", title="LDM: reduced runs of two elastic bodies",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 120})
def several_bodies(run):
    """Record the errors of held-out runs of both starts, beside those of their rivals."""
    transfers, count, repeats = run.choose(quick=(TRANSFERS[:1], 1, 1),
                                           standard=(TRANSFERS, len(TEST), 3))
    rows = []
    for start in run.progress(STARTS, "starts"):
        for transfer in transfers:
            with one_thread():
                trained = training(start, transfer)
                tests = {speed: rivals_of(trained, speed) for speed in TEST[:count]}
                found = rivals.compare(tests, repeats)
            record(run, trained, tests, found)
            rows += [(start, transfer, *row[1:]) for row in rivals.rows_of(start, found.errors)]
    run.table("runs", COLUMNS, rows)


def record(run, trained, tests, comparison):
    """Record the errors of the rivals of a `Comparison`, the nearest states of the modes, and which
    reduced run is below what.
    """
    id = f"ldm.several-bodies.{trained.start}.{trained.transfer}"
    full = next(iter(tests.values())).test
    scale = (f"{len(full.X)} particles of two bodies, {STEPS} steps, {len(TRAIN)} training runs, "
             f"{len(tests)} held out")
    errors = {one.name: one.errors for one in comparison.rivals}
    cpu = {one.name: one.cpu for one in comparison.rivals}
    for name in LOOKED_UP:
        record_error(run, f"{id}.{name}", errors[name], scale, "looked up")
    for r, g in trained.maps.items():
        own = errors[name_of(r)]
        best = nearest_state_errors(full.X, [one.test.x for one in tests.values()], g, np.zeros(r))
        record_error(run, f"{id}.{name_of(r)}", own, scale, f"nearest states of the modes "
                     f"{100.0 * best.displacement:.3g} %")
        record_error(run, f"{id}.{name_of(r)}.states", best, scale, "nearest states, no dynamics")
        for name in LOOKED_UP:
            run.record(f"{id}.{name_of(r)}.over.{name}",
                       own.displacement / errors[name].displacement, comparator="<=", bound=1.0,
                       scale=scale,
                       note=f"error of the displacement over that of {LOOKED_UP[name]}")
        run.record(f"{id}.{name_of(r)}.cost", cpu[name_of(r)] / cpu[FULL], unit="x",
                   comparator="info", scale=scale, note="CPU time of a run over that of the full "
                   "run, all points as samples, one thread")


def record_error(run, target, errors, scale, note):
    """Record the displacement error of `PositionErrors`, in per cent."""
    run.record(target, 100.0 * errors.displacement, unit="%", comparator="info", scale=scale,
               note=f"of the displacement; {note}; of the distance from the centroid "
               f"{100.0 * errors.centroid:.3g} %")
