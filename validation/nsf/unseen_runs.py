"""Runs unlike those of training: bread with other weak elements (Figure 14), and sand with more
friction than any training run (Figure 17).
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
from .errors import COLUMNS, MODES, error_rows, mean, record_mean
from .reduced_runs import fit_study
from .states import keep_runs, keep_states
from .studies import bread, sand

SCALES = {"mild": 0.08, "aggressive": 0.3}      # of the slice's width
ANGLES = (44.0, 55.0)
E = 6.0                 # of the bread
SEEDS = 3
FREE = (0.4, 0.6)       # the part of the slice between the held ends, along x [m]


@experiment("nsf.fig14", title="NSF: bread with other weak elements",
            budget={"quick": 20, "standard": 300, "paper": 3600})
def weak(run):
    """The weak boxes are shifted along the pull, each by a random share of the slice's width; what
    the paper perturbs is not printed. Keeps the last draw of both.
    """
    one = fit_study(run.choose(quick=lambda: bread(3, train=6), standard=lambda: bread(2),
                               paper=bread)()._replace(test=(E,)))
    rows, last_draws = [], {}
    for name, scale in SCALES.items():
        new = []
        for seed in range(run.choose(quick=1, standard=SEEDS, paper=SEEDS)):
            test = simulated(one, shifted(one.study.run(E), scale, seed))
            last_draws[name] = one._replace(tests={E: test}), E
            new += error_rows(last_draws[name][0], name, one.study.samples, (seed,))
        record_mean(run, f"nsf.appB.bread.{name}.error.{MODES}", new, one.scale,
                    f"weak boxes shifted by {100 * scale:g} % of the slice's width at most, "
                    f"E = {E:g}")
        rows += new
    usual = error_rows(one, "trained", one.study.samples, (0,))
    record_mean(run, "nsf.fig14.trained", usual, one.scale, "weak boxes of training",
                comparator="info")
    run.table("errors", COLUMNS, rows + usual)
    keep_runs(run, last_draws)


@experiment("nsf.fig17", title="NSF: sand steeper than all that was trained",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def steep(run):
    """Angles of friction of 44 and 55 degrees, where training ends at 38.5."""
    study = run.choose(quick=lambda: sand(3, train=4), standard=lambda: sand(2, train=8),
                       paper=sand)
    one = fit_study(study()._replace(test=ANGLES))
    draws = range(run.choose(quick=1, standard=SEEDS, paper=SEEDS))
    errors = error_rows(one, "steep", one.study.samples, draws)
    by_angle = {value: [row for row in errors if row[1] == value] for value in ANGLES}
    last = 100.0 * one.nearest_run_errors(ANGLES[0]).origin
    record_mean(run, f"nsf.appB.sand.extrap_error.{MODES}", by_angle[44.0], one.scale,
                f"44 degrees; the steepest training run, taken as it is: {last:.3g} %")
    record_mean(run, "nsf.fig17.55", by_angle[55.0], one.scale,
                "55 degrees; the paper shows that it fails", comparator="info")
    run.record("nsf.fig17.stress.55", 100.0 * mean(by_angle[55.0], "stress"), unit="%",
               scale=one.scale, comparator="info", note="of the Kirchhoff stress")
    for value in ANGLES:
        run.record(f"nsf.fig17.beyond.{value:g}", farthest(one, value), scale=one.scale,
                   comparator="info", note="largest distance of a state's latent coordinates from "
                   f"trained ones, over their largest gap; out of bounds above {BEYOND:g}")
    run.table("errors", COLUMNS, [row for rows in by_angle.values() for row in rows])
    keep_states(run, one, ANGLES)


def farthest(one, value):
    """Return the largest `StateCheck.beyond` of the states of a reduced run with the study's
    samples.
    """
    scene, distances = nsf_full_model(one.study.run(value)), []
    monitor = field_monitor(one.fields, one.xhat)
    plan = FieldRunOptions(one.study.chosen(scene, one.study.samples, 0))
    with suppress(*BREAKDOWNS):
        for state in nsf_run(scene, one.fields_of_run(value), plan, one.rest).states():
            distances.append(monitor.check(state).beyond)
    return max(distances)


def shifted(scene, scale, seed):
    """Return the bread whose weak boxes are shifted along x, each by a random share of the slice's
    width, and stay between the held ends.
    """
    strong, seam = scene.body
    slab = strong.shape.shape
    width = slab.upper[0] - slab.lower[0]
    shifts = scale * width * np.random.default_rng(seed).uniform(-1.0, 1.0, len(seam.shape.shapes))
    boxes = tuple(map(shifted_box, seam.shape.shapes, shifts))
    return with_(scene, body=(with_(strong, shape=with_(strong.shape, minus=boxes)),
                              with_(seam, shape=with_(seam.shape, shapes=boxes))))


def shifted_box(box, shift):
    """Return a box shifted along x as far as the held ends let it."""
    shift = float(np.clip(shift, FREE[0] - box.lower[0], FREE[1] - box.upper[0]))
    along = partial(np.add, (shift, 0.0, 0.0))
    return with_(box, lower=tuple(along(box.lower)), upper=tuple(along(box.upper)))


def simulated(one, scene):
    """Return the `Histories` of a run of the same points, in the order of the training runs."""
    study = one.study
    run = simulate_history(scene, [E], np.float32, study.spacing)
    distance, order = KDTree(run.X).query(one.runs.X)
    if len(run.X) != len(one.runs.X) or distance.max() > 1e-9 * nsf_full_model(scene).problem.dx:
        raise ValueError(f"the points differ by up to {distance.max():.3g} m from those of "
                         "training: expected the same slice")
    fields = {name: getattr(run, name)[:, :, order] for name in ("x", "tau", "C")}
    return run._replace(X=run.X[order], v=run.v[:, order], **fields)
