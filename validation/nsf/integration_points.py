"""Nodes and integration points that follow from samples (NSF-sec5.4, Figure 4)."""

from itertools import product

import numpy as np

from mpm_ref.rom.quadrature.stencil_overlap import bases, stencil_overlap
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.full_model import nsf_full_model

from ..common.registry import experiment
from ..ldm.published_bodies import keep
from .memory import shear
from .studies import cake

FEW = 3             # samples of the block, so that their nodes can be told apart
MOST = 8000         # points kept of a scene, but samples and integration points, which all are
FLAT = 2            # axes of a scene whose nodes are kept


@experiment("nsf.fig4", title="NSF: samples, nodes and integration points",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 60})
def sets(run):
    """Keeps the points of a state half-way, the samples and integration points among them, of a
    block in 2D, with the nodes of its samples, and of the cake.
    """
    pie = cake(run.choose(quick=3, standard=2))
    arrays = {}
    for name, study, count in (("block", shear(), FEW), ("cake", pie, pie.samples)):
        one, x = middle_state(study)
        samples = study.chosen(one, count, 0)[0].points
        dx, degree = one.problem.dx, one.problem.scheme.degree
        near = stencil_overlap(x[samples], dx, degree).overlaps(x)
        nodes = nodes_of(x[samples], dx, degree)
        record(run, f"nsf.fig4.{name}", samples, nodes, near)
        arrays |= {f"{name}_{word}": points for word, points in
                   (("x", thinned(x)), ("integration", x[near]), ("sample", x[samples]))}
        if x.shape[1] == FLAT:
            arrays[f"{name}_nodes"] = dx * nodes
    keep(run, **arrays)


def thinned(x):
    """Return at most `MOST` of points x (n, d)."""
    return x[::-(-len(x) // MOST)]


def middle_state(study):
    """Return the `FullModel` of a study's last training run, and its points (n, d) half-way [m]."""
    scene = study.run(study.train[-1])
    x = simulate_history(scene, [study.train[-1]], every=study.spacing).x[0]
    return nsf_full_model(scene), x[len(x) // 2]


def nodes_of(x, dx, degree):
    """Return the numbers (k, d) of the nodes I in the supports of samples x (m, d) [m]."""
    offsets = np.array([*product(range(degree + 1), repeat=x.shape[1])])
    return np.unique((bases(x, dx, degree)[:, None] + offsets).reshape(-1, x.shape[1]), axis=0)


def record(run, target, samples, nodes, near):
    """Record how many samples, nodes and integration points there are."""
    scale = f"{len(near)} particles"
    for word, count in (("samples", len(samples)), ("nodes", len(nodes)), ("points", near.sum())):
        run.record(f"{target}.{word}", count, unit="1", comparator="info", scale=scale)
