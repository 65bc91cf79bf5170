"""Networks at a hundred times as many points as in training (Figure 6), compared with the
full-order run of these points on the same grid, and with the displacement of the nearest training
point.
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
    """Errors of the jelly cube, whose networks are trained; the paper shows sand. Latent
    coordinates are those of the states nearest to the run of the training's points.
    """
    for model in load_available(run, [NAME], trained).values():
        study = nets()[NAME].study
        scene, fields = study.run(study.test[0]), fields_of(model, study)
        few = states(scene)
        many = states(finer(scene, run.choose(quick=4, standard=100)))
        path = [xhat for _, xhat in nearest_states(fields, few.x[0], model.rest)]
        record_resolutions(run, fields.g, few, many, path)


def record_resolutions(run, g, few, many, xhat):
    """Record errors of a map at few and at many points of the same run, and keep both; xhat: of
    each level of the run.
    """
    scale = f"{len(many.X)} points, trained at {len(few.X)}"
    _, near = KDTree(few.X).query(many.X)
    few_errors, many_errors, nearest_errors = (Squares(X) for X in (few.X, many.X, many.X))
    shown = []
    for k in range(1, SHOTS + 1):
        x = g.place(many.X, xhat[k])
        few_errors.add(g.place(few.X, xhat[k]), few.x[0, k])
        many_errors.add(x, many.x[0, k])
        nearest_errors.add(many.X + (few.x[0, k] - few.X)[near], many.x[0, k])
        shown.append(x)
    for word, squares, note in (("few", few_errors, "at the points of the training"),
                                ("many", many_errors, "at the many points"),
                                ("nearest", nearest_errors,
                                 "the many points, moved as the nearest of "
                                 "the few are in the full-order run")):
        run.record(f"nsf.fig6.{word}", 100.0 * squares.errors.displacement, unit="%", scale=scale,
                   comparator="info", note=f"{note}; displacement of cube and wall, {SHOTS} times, "
                   "at the coordinates nearest to the full-order run of the few")
    keep(run, few=thinned(few.x[0, 1:], MOST), many=thinned(many.x[0, 1:], SHOWN),
         networks=thinned(np.array(shown), SHOWN))


def finer(scene, factor):
    """Return a scene with `factor` times as many points on the same grid."""
    return with_values(scene, {f"body.{body.name}.sampling.count": factor * body.sampling.count
                               for body in scene.body if isinstance(body.sampling, Poisson)})


def states(scene):
    """Return the `Histories` of a run at `SHOTS` times after the start."""
    return simulate_history(scene, [0.0], np.float32, scene.steps // SHOTS)


def thinned(x, most):
    """Return at most `most` of the points of x (levels, n, d)."""
    return x[:, ::-(-x.shape[1] // most)]
