"""Figures 7 and 8: kernels and sparsity of the levels of a node-embedding hierarchy.

*Kernels*: the particle-grid kernel of each level.

*Sparsity*: only the coupling of nodes is formed, so that the paper's size is affordable: nodes that
share a particle (level 0), the Galerkin product of that pattern (ours), and nodes of a coarser grid
that share a particle (geometric multigrid, which takes the particles to every grid anew). A pair of
coupled nodes is a block of d x d of non-zeros.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpm_ref.hot.multigrid.embedding import embed, kernel_value, width
from mpm_ref.scene import build

from ..common.registry import experiment
from .sizes import sized

LEVELS = 5
SCENE = "hot_armacat"
D = 3                   # axes of the scene: rows per node
KERNEL_LEVELS = (0, 1, 2, 3)
STEP = 1.0 / 64         # own cells between the samples of a kernel
EMBEDDINGS = {"lin": "linear", "quad": "quadratic"}


def support(kernel, level):
    """Return the width outside of which the kernel of a level is zero, by samples [own cells]."""
    x = np.arange(-2.5, 2.5 + STEP, STEP)
    inside = x[kernel_value(x, kernel, level) > 0.0]
    return float(inside[-1] - inside[0] + 2.0 * STEP)


def unity(kernel, level):
    """Return the largest departure from 1 of the sum of all nodes' kernels at a point."""
    x = np.linspace(0.0, 1.0, 101)
    total = sum(kernel_value(x - c, kernel, level) for c in range(-3, 5))
    return float(np.max(np.abs(total - 1.0)))


@experiment("hot.fig7", title="Kernels of the levels, linear and quadratic embedding",
            budget={"quick": 1, "standard": 1, "paper": 1})
def kernels(run):
    """Record widths as printed, partition of unity, and the curves."""
    for short, word in EMBEDDINGS.items():
        for level in KERNEL_LEVELS[1:]:
            run.record(f"hot.fig7.{short}.level{level}", support(word, level),
                       scale="kernel sampled at 64 points a cell",
                       note=f"by the recursion of widths {width(word, level):g}")
        run.record(f"hot.fig7.{short}.unity", max(unity(word, level) for level in KERNEL_LEVELS),
                   comparator="<=", bound=1e-14, scale="levels 0 to 3",
                   note="the kernels of a level sum to one")
    run.record("hot.sec4_2.width_fine", support("linear", 0))
    run.record("hot.sec4_2.width_lin_limit", width("linear", 40), scale="level 40")
    run.record("hot.fig7.halfwidth_quad_limit", width("quadratic", 40) / 2.0, scale="level 40")
    x = np.arange(-2.0, 2.0 + STEP, STEP)
    run.table("curves", ("x", *(f"{s}{level}" for s in EMBEDDINGS for level in KERNEL_LEVELS)),
              list(zip(x, *(kernel_value(x, w, level) for w in EMBEDDINGS.values()
                            for level in KERNEL_LEVELS), strict=True)))


class LevelRow(NamedTuple):
    """One level of one hierarchy."""

    kind: str           # "linear" or "quadratic" embedding, "geometric"
    level: int
    rows: int
    nonzeros: int
    per_row: float


def level_row(kind, level, pattern):
    """Return the `LevelRow` of a pattern over nodes."""
    rows, nonzeros = D * pattern.shape[0], D * D * pattern.nnz
    return LevelRow(kind, level, rows, nonzeros, nonzeros / rows)


def particle_pattern(x, dx):
    """Return (pattern, world indices) of nodes in the splines of points x (N, d).

    The splines are quadratic.
    """
    d = x.shape[1]
    # particles with a base node in common have the same nodes
    cells = np.unique(np.floor(x / dx - 0.5).astype(np.int64), axis=0)
    near = np.stack(np.meshgrid(*[np.arange(3)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    index, number = np.unique((cells[:, None, :] + near).reshape(-1, d), axis=0,
                              return_inverse=True)
    cell = np.repeat(np.arange(len(cells)), len(near))
    weight = sp.csr_array((np.ones(len(cell)), (cell, number.reshape(-1))),
                          shape=(len(cells), len(index)))
    return weight.T @ weight, index


def galerkin(pattern, index, kernel):
    """Return (pattern, world indices) of the next level: positive weights cancel nothing."""
    coarser = embed(index, kernel)
    return coarser.W.T @ pattern @ coarser.W, coarser.index


def embedded_levels(x, dx, kernel):
    """Return the `LevelRow`s of a node-embedding hierarchy."""
    pattern, index = particle_pattern(x, dx)
    rows = [level_row(kernel, 0, pattern)]
    for level in range(1, LEVELS):
        pattern, index = galerkin(pattern, index, kernel)
        rows.append(level_row(kernel, level, pattern))
    return rows


def geometric_levels(x, dx):
    """Return the `LevelRow`s of grids of spacing 2^level dx that the particles go to."""
    return [level_row("geometric", level, particle_pattern(x, dx * 2.0**level)[0])
            for level in range(LEVELS)]


@experiment("hot.fig8", title="Non-zeros by level: node embedding and geometric multigrid",
            budget={"quick": 3, "standard": 5, "paper": 30})
def sparsity(run):
    """Record armadillo and cat at their start, held nodes counted as free."""
    problem = build(sized(SCENE, run.profile))
    x = np.concatenate([body.particles.x for body in problem.bodies])
    rows = [*embedded_levels(x, problem.dx, "linear"),
            *embedded_levels(x, problem.dx, "quadratic"), *geometric_levels(x, problem.dx)]
    levels = {(row.kind, row.level): row for row in rows}
    scale = f"{len(x)} particles, dx = {problem.dx:g} m (paper: 403 000 at 0.04 m)"
    record_printed(run, levels, scale)
    record_ratio(run, levels, scale)
    run.table("levels", LevelRow._fields, rows)


def record_printed(run, levels, scale):
    """Record the printed numbers; small bodies are all rim, with few nodes on coarse grids."""
    printed = {"l0": ("linear", 0), "l4": ("linear", 4), "gmg4": ("geometric", 4)}
    for short, key in printed.items():
        row = levels[key]
        size = "" if run.profile == "paper" else ".small"
        run.record(f"hot.fig8.{short}.nnz{size}", row.nonzeros, scale=scale)
        run.record(f"hot.fig8.{short}.nnz_row{size}", row.per_row, scale=scale,
                   note=f"{row.rows} rows")
    run.record("hot.fig8.levels_shown", LEVELS, scale=scale)


def record_ratio(run, levels, scale):
    """Record the ratio of non-zeros: ours is the sparser hierarchy."""
    ours, theirs = levels["linear", 4], levels["geometric", 4]
    run.record("hot.fig8.geometric", theirs.nonzeros / ours.nonzeros, paper=1.72e5 / 7.05e4,
               comparator=">=", bound=1.0, scale=scale,
               note="non-zeros at level 4, geometric over ours")
