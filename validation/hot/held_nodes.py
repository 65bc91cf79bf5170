"""Effect of held nodes on coarse levels: masked out of them, as here, or leaking into them.

Here a held direction has zero rows, and the prolongation to it is masked. In the authors' release
the finest matrix has an identity block there, of 1 kg whatever the size of the others, and nothing
is masked, so that a coarse matrix has more:

    A_c = P^T B H B P,    leaking  A_c + s P^T (1 - B) P,    s = 1 kg

Near held nodes it is stiffer and corrects less. The cycles are tried on one matrix, by their
convergence factor on the free nodes, and as preconditioner of CG.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpm_ref.hot.multigrid.hierarchy import hierarchy
from mpm_ref.hot.multigrid.projectors import block_diagonal, diagonal_blocks, onto_range

from ..common.registry import experiment
from .linear_system import CGLimits, FrozenSystem, cg, convergence_factor, frozen, linearized
from .one_step import step_after
from .stiffness import bar
from .warm_states import following_steps, warm_state

TREATMENTS = {
    "masked": "prolongations masked",
    "leaking": "identity blocks of 1 kg where nodes are held, nothing masked",
    "leaking-scaled": "the same, blocks of the mean diagonal",
}
LEVELS = (2, 3)
CAP = 800           # iterations of CG
FINE = 1e-14        # reduction at which the extreme eigenvalues have converged
STEPS = 3           # of the bar, before
SCENES = ("faceless", "twist")


class ConstrainedMatrix(NamedTuple):
    """The matrix of a step with n nodes, some of which are held."""

    A: sp.bsr_array         # (n d, n d)  rows and columns of held nodes are zero [kg]
    index: np.ndarray       # (n, d)      world indices
    is_free: np.ndarray     # (n,)        whether a node is free
    system: FrozenSystem          # of the free nodes


class CycleQuality(NamedTuple):
    """Convergence of a cycle by itself and as preconditioner."""

    coarsest: int           # nodes on the coarsest level
    factor: float           # per cycle, on its own
    iterations: int         # of CG
    converged: bool


def constrained_matrix(A, index, b, particles):
    """Return the `ConstrainedMatrix` of a matrix A; other arguments as of `frozen`."""
    free = onto_range(diagonal_blocks(A)).any(axis=(1, 2))
    return ConstrainedMatrix(A, index, free, frozen(A, index, b, particles))


def treated_hierarchy(given, treatment, levels):
    """Return the hierarchy by one of TREATMENTS, its coarsest level solved exactly.

    A matrix without zero rows is masked nowhere.
    """
    A, d = given.A, given.index.shape[1]
    if treatment != "masked":
        size = 1.0 if treatment == "leaking" else mean_diagonal(given)
        A = sp.bsr_array(A + block_diagonal(size * np.eye(d) * ~given.is_free[:, None, None]))
        A.sort_indices()
    return hierarchy(A, given.index, levels, implementation="scipy", coarsest="direct")


def mean_diagonal(given):
    """Return the mean diagonal entry of the free nodes [kg]."""
    return float(given.system.A.diagonal().mean())


def on_free(given, grids):
    """Return one cycle as r -> u over the free nodes (m, d); values of held nodes are dropped."""
    def inverse(r):
        full = np.zeros(given.index.shape)
        full[given.is_free] = r
        return grids.cycle(full)[given.is_free]
    return inverse


def cycle_quality(given, treatment, levels, noise):
    """Return the `CycleQuality` of a treatment.

    noise: random right-hand side (m, d) on the free nodes, by which CG samples the spectrum: in the
    step's own gradient slow modes may be faint.
    """
    grids = treated_hierarchy(given, treatment, levels)
    inverse = on_free(given, grids)
    history = cg(given.system, inverse, CGLimits(cap=CAP))
    longer = cg(given.system._replace(b=noise), inverse, CGLimits(FINE, CAP))
    return CycleQuality(len(grids.levels[-1].index), convergence_factor(longer), history.iterations,
                        history.converged)


def matrices(dx, moduli, scenes):
    """Yield (name, `ConstrainedMatrix`) of the twisted bar at some moduli, and of scenes."""
    for E in moduli:
        step = step_after(bar(dx, E, "hot", STEPS), STEPS)
        yield f"bar.E{E:.0e}".replace("e+0", "e"), constrained_matrix(*linearized(step))
    for name in scenes:
        step = next(following_steps(*warm_state(name, "quick"), 1))
        yield name, constrained_matrix(*linearized(step))


@experiment("hot.held_nodes", title="Held nodes masked out of coarse levels, or leaking into them",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def held_nodes(run):
    """Record factors and CG iterations on matrices with many held nodes."""
    cases = matrices(*run.choose(quick=(0.04, (1e5,), ()), standard=(0.03, (1e5, 1e9), SCENES)))
    rows = []
    for name, given in cases:
        noise = run.rng.standard_normal(given.system.b.shape)
        for levels in LEVELS:
            qualities = {treatment: cycle_quality(given, treatment, levels, noise)
                         for treatment in run.progress(TREATMENTS, name)}
            record_factors(run, f"hot.held_nodes.{name}.levels{levels}", given, qualities)
            rows += [(name, levels, treatment, *q) for treatment, q in qualities.items()]
    run.table("cycles", ("matrix", "levels", "treatment", *CycleQuality._fields), rows)


def record_factors(run, target, given, qualities):
    """Record the factor of every treatment."""
    n = len(given.index)
    scale = (f"{given.system.particles} particles, {n} nodes, {n - given.is_free.sum()} held; mean "
             f"diagonal {mean_diagonal(given):.3g} kg")
    for treatment, q in qualities.items():
        missed = "" if q.converged else ", the cap, and not there"
        run.record(f"{target}.{treatment}", q.factor, comparator="info", scale=scale,
                   note=f"{TREATMENTS[treatment]}; 1 - {1.0 - q.factor:.3e} per cycle, the "
                        f"coarsest of {q.coarsest} nodes solved exactly; {q.iterations} CG "
                        f"iterations to 1e-6{missed}")
