"""Networks at points that no training has seen, a hundred times as many (Figure 6): beside the
full-order run of these points on the same grid, and beside what the nearest training point does.
"""

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.errors import Squares
from mpm_ref.rom.study.evaluate import nearest_states
from mpm_ref.scene import Poisson
from mpm_ref.scene.overrides import with_values

from ..common.registry import experiment
from ..common.weights_needed import load_available
from ..ldm.published_bodies import keep
from .networks import fields_of, nets, trained
from .states import MOST, SHOTS

NAME = "jelly"
SHOWN = 20000           # of the many points


@experiment("nsf.fig6", title="NSF: a hundred times as many points",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 300})
def boost(run):
    """Of the jelly cube, whose networks are trained; the paper shows sand. Latent coordinates are
    those of the states nearest to the run of the training's points.
    """
    for model in load_available(run, [NAME], trained).values():
        study = nets()[NAME].study
        scene, fields = study.run(study.test[0]), fields_of(model, study)
        few = states(scene)
        many = states(finer(scene, run.choose(quick=4, standard=100)))
        found = [xhat for _, xhat in nearest_states(fields, few.x[0], model.rest)]
        compared(run, fields.g, few, many, found)


def compared(run, g, few, many, xhat):
    """Record errors of a map at few and at many points of the same run, and keep both; xhat: of
    each level of the run.
    """
    factor, scale = len(many.X) / len(few.X), f"{len(many.X)} points, trained at {len(few.X)}"
    run.record("nsf.fig6.resolution_boost", factor, scale=scale,
               note="as many points as are asked for; what they are worth: see the errors",
               **({} if run.profile == "standard" else {"comparator": "info"}))
    _, near = KDTree(few.X).query(many.X)
    of_few, of_many, of_nearest = (Squares(X) for X in (few.X, many.X, many.X))
    shown = []
    for k in range(1, SHOTS + 1):
        x = g.place(many.X, xhat[k])
        of_few.add(g.place(few.X, xhat[k]), few.x[0, k])
        of_many.add(x, many.x[0, k])
        of_nearest.add(many.X + (few.x[0, k] - few.X)[near], many.x[0, k])
        shown.append(x)
    for word, squares, note in (("few", of_few, "at the points of the training"),
                                ("many", of_many, "at the many points"),
                                ("nearest", of_nearest, "the many points, moved as the nearest of "
                                 "the few are in the full-order run")):
        run.record(f"nsf.fig6.{word}", 100.0 * squares.errors.displacement, unit="%", scale=scale,
                   comparator="info", note=f"{note}; displacement of cube and wall, {SHOTS} times, "
                   "at the coordinates nearest to the full-order run of the few")
    keep(run, few=thinned(few.x[0, 1:], MOST), many=thinned(many.x[0, 1:], SHOWN),
         networks=thinned(np.array(shown), SHOWN))


def finer(scene, factor):
    """A scene with so many times as many points on the same grid."""
    return with_values(scene, {f"body.{body.name}.sampling.count": factor * body.sampling.count
                          for body in scene.body if isinstance(body.sampling, Poisson)})


def states(scene):
    """`Histories` of a run at `SHOTS` times after the start."""
    return simulate_history(scene, [0.0], np.float32, scene.steps // SHOTS)


def thinned(x, most):
    """At most so many of the points of x (levels, n, d)."""
    return x[:, ::-(-x.shape[1] // most)]
