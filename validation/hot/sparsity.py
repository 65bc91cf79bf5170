"""Figure 8: how full the matrices of a hierarchy are, by level.

Only who couples with whom is formed, so that the paper's size is in reach: nodes that share a
particle (level 0), the Galerkin product of that pattern (ours), and nodes of a coarser grid that
share a particle (geometric multigrid, which takes the particles to every grid anew). A pair of
coupled nodes is a block of d x d of non-zeros.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpm_ref.hot.multigrid.embedding import embed
from mpm_ref.scene import build

from ..common.registry import experiment
from .sizes import sized

LEVELS = 5
SCENE = "hot_armacat"
D = 3                   # axes of the scene: rows per node


class Row(NamedTuple):
    """One level of one hierarchy."""

    kind: str           # "linear" or "quadratic" embedding, "geometric"
    level: int
    rows: int
    nonzeros: int
    per_row: float


def of(kind, level, pattern):
    """`Row` of a pattern over nodes."""
    rows, nonzeros = D * pattern.shape[0], D * D * pattern.nnz
    return Row(kind, level, rows, nonzeros, nonzeros / rows)


def of_particles(x, dx):
    """(pattern, world indices) of the nodes that quadratic splines of the points x (N, d) reach."""
    d = x.shape[1]
    # particles with a base node in common reach the same nodes
    cells = np.unique(np.floor(x / dx - 0.5).astype(np.int64), axis=0)
    near = np.stack(np.meshgrid(*[np.arange(3)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    index, number = np.unique((cells[:, None, :] + near).reshape(-1, d), axis=0,
                              return_inverse=True)
    cell = np.repeat(np.arange(len(cells)), len(near))
    reach = sp.csr_array((np.ones(len(cell)), (cell, number.reshape(-1))),
                         shape=(len(cells), len(index)))
    return reach.T @ reach, index


def galerkin(pattern, index, kernel):
    """(pattern, world indices) of the next level: positive weights cancel nothing."""
    coarser = embed(index, kernel)
    return coarser.W.T @ pattern @ coarser.W, coarser.index


def embedded(x, dx, kernel):
    """`Row`s of a node-embedding hierarchy."""
    pattern, index = of_particles(x, dx)
    rows = [of(kernel, 0, pattern)]
    for level in range(1, LEVELS):
        pattern, index = galerkin(pattern, index, kernel)
        rows.append(of(kernel, level, pattern))
    return rows


def geometric(x, dx):
    """`Row`s of grids of spacing 2^level dx that the particles go to."""
    return [of("geometric", level, of_particles(x, dx * 2.0**level)[0]) for level in range(LEVELS)]


@experiment("hot.fig8", title="Non-zeros by level: node embedding and geometric multigrid",
            budget={"quick": 3, "standard": 5, "paper": 30})
def sparsity(run):
    """Armadillo and cat where they start, held nodes counted as free."""
    problem = build(sized(SCENE, run.profile))
    x = np.concatenate([body.particles.x for body in problem.bodies])
    rows = [*embedded(x, problem.dx, "linear"), *embedded(x, problem.dx, "quadratic"),
            *geometric(x, problem.dx)]
    found = {(row.kind, row.level): row for row in rows}
    scale = f"{len(x)} particles, dx = {problem.dx:g} m (paper: 403 000 at 0.04 m)"
    record_printed(run, found, scale)
    record_ratio(run, found, scale)
    run.table("levels", Row._fields, rows)


def record_printed(run, found, scale):
    """What the paper prints; small bodies are all rim, and coarse grids of them a few nodes."""
    printed = {"l0": ("linear", 0), "l4": ("linear", 4), "gmg4": ("geometric", 4)}
    for short, key in printed.items():
        row = found[key]
        rule = {} if run.profile == "paper" else {"comparator": "info"}
        run.record(f"hot.fig8.{short}.nnz", row.nonzeros, scale=scale, **rule)
        run.record(f"hot.fig8.{short}.nnz_row", row.per_row, scale=scale, **rule,
                   note=f"{row.rows} rows")
    run.record("hot.fig8.levels_shown", LEVELS, scale=scale)


def record_ratio(run, found, scale):
    """Ours is the sparser one."""
    ours, theirs = found["linear", 4], found["geometric", 4]
    run.record("hot.fig8.geometric", theirs.nonzeros / ours.nonzeros, paper=1.72e5 / 7.05e4,
               comparator=">=", bound=1.0, scale=scale,
               note="non-zeros at level 4, geometric over ours")
