"""Runs that training has nothing like: bread with other weak elements (Figure 14), and sand whose
friction is past all that was trained (Figure 17).
"""

from contextlib import suppress
from functools import partial

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.rom.extrapolation import BEYOND
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.monitor import field_monitor
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run

from ..common.registry import experiment
from ..common.scenes import with_
from .errors import COLUMNS, mean, rows_of, share
from .reduced_runs import tested
from .states import keep_runs, keep_states
from .studies import bread, sand

SCALES = {"mild": 0.08, "aggressive": 0.3}      # of the slice's width
ANGLES = (44.0, 55.0)
E = 6.0                 # of the bread
SEEDS = 3
FREE = (0.4, 0.6)       # what is not held of the slice, along x [m]


@experiment("nsf.fig14", title="NSF: bread with other weak elements",
            budget={"quick": 20, "standard": 300, "paper": 3600})
def weak(run):
    """The weak boxes are shifted along the pull, each by a random share of the slice's width; what
    the paper perturbs is not printed. Keeps the last draw of both.
    """
    one = tested(run.choose(quick=lambda: bread(3, train=6), standard=lambda: bread(2),
                            paper=bread)()._replace(test=(E,)))
    rows, kept = [], {}
    for name, scale in SCALES.items():
        found = []
        for seed in range(run.choose(quick=1, standard=SEEDS, paper=SEEDS)):
            test = other(one, shifted(one.study.run(E), scale, seed))
            kept[name] = one._replace(tests={E: test}), E
            found += rows_of(kept[name][0], name, one.study.samples, (seed,))
        run.record(f"nsf.appB.bread.{name}.perturb", 100.0 * scale, unit="%", scale=one.scale)
        share(run, f"nsf.appB.bread.{name}.error", found, one.scale,
              f"weak boxes shifted by {100 * scale:g} % of the slice's width at most, E = {E:g}")
        rows += found
    usual = rows_of(one, "trained", one.study.samples, (0,))
    share(run, "nsf.fig14.trained", usual, one.scale, "weak boxes of training", comparator="info")
    run.table("errors", COLUMNS, rows + usual)
    keep_runs(run, kept)


@experiment("nsf.fig17", title="NSF: sand steeper than all that was trained",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def steep(run):
    """Angles of friction of 44 and 55 degrees, where training ends at 38.5."""
    study = run.choose(quick=lambda: sand(3, train=4), standard=lambda: sand(2, train=8),
                       paper=sand)
    one = tested(study()._replace(test=ANGLES))
    found = {value: [row for row in rows_of(one, "steep", one.study.samples, (0, 1, 2))
                     if row[1] == value] for value in ANGLES}
    last = 100.0 * one.next_run(ANGLES[0]).origin
    share(run, "nsf.appB.sand.extrap_error", found[44.0], one.scale,
          f"44 degrees; the steepest training run, taken as it is: {last:.3g} %")
    share(run, "nsf.fig17.55", found[55.0], one.scale, "55 degrees; the paper shows that it fails",
          comparator="info")
    run.record("nsf.fig17.stress.55", 100.0 * mean(found[55.0], "stress"), unit="%",
               scale=one.scale, comparator="info", note="of the Kirchhoff stress")
    for value in ANGLES:
        run.record(f"nsf.fig17.beyond.{value:g}", farthest(one, value), scale=one.scale,
                   comparator="info", note="largest distance of a state's latent coordinates from "
                   f"trained ones, over their largest gap; out of bounds above {BEYOND:g}")
    run.table("errors", COLUMNS, [row for rows in found.values() for row in rows])
    keep_states(run, one, ANGLES)


def farthest(one, value):
    """Largest `StateCheck.beyond` of the states of a reduced run with the study's samples."""
    scene, found = nsf_full_model(one.study.run(value)), []
    monitor = field_monitor(one.fields, one.xhat)
    plan = FieldRunOptions(one.study.chosen(scene, one.study.samples, 0))
    with suppress(*BREAKDOWNS):
        for state in nsf_run(scene, one.of(value), plan, one.rest).states():
            found.append(monitor.check(state).beyond)
    return max(found)


def shifted(scene, scale, seed):
    """The bread whose weak boxes are shifted along x, each by a random share of the slice's width,
    and stay between the held ends.
    """
    strong, seam = scene.body
    slab = strong.shape.shape
    width = slab.upper[0] - slab.lower[0]
    shifts = scale * width * np.random.default_rng(seed).uniform(-1.0, 1.0, len(seam.shape.shapes))
    boxes = tuple(map(moved, seam.shape.shapes, shifts))
    return with_(scene, body=(with_(strong, shape=with_(strong.shape, minus=boxes)),
                              with_(seam, shape=with_(seam.shape, shapes=boxes))))


def moved(box, shift):
    """A box shifted along x as far as the held ends let it."""
    shift = float(np.clip(shift, FREE[0] - box.lower[0], FREE[1] - box.upper[0]))
    along = partial(np.add, (shift, 0.0, 0.0))
    return with_(box, lower=tuple(along(box.lower)), upper=tuple(along(box.upper)))


def other(one, scene):
    """`Histories` of a run of the same points, in the order of the training runs."""
    study = one.study
    run = simulate_history(scene, [E], np.float32, study.spacing)
    apart, order = KDTree(run.X).query(one.runs.X)
    if len(run.X) != len(one.runs.X) or apart.max() > 1e-9 * nsf_full_model(scene).problem.dx:
        raise ValueError(f"the points differ by up to {apart.max():.3g} m from those of training: "
                         "expected the same slice")
    fields = {name: getattr(run, name)[:, :, order] for name in ("x", "tau", "C")}
    return run._replace(X=run.X[order], v=run.v[:, order], **fields)
