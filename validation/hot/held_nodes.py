"""What held nodes do to coarse levels: masked out of them, as here, or leaking into them.

Here a held direction has zero rows, and the prolongation to it is masked. In the authors' release
the finest matrix has an identity block there, of 1 kg whatever the size of the others, and nothing
is masked, so that a coarse matrix has more:

    A_c = P^T B H B P,    leaking  A_c + s P^T (1 - B) P,    s = 1 kg

Near held nodes it is stiffer and corrects less. The cycles are tried on one matrix, by their
convergence factor on what is free, and as preconditioner of CG.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpm_ref.hot.multigrid.hierarchy import hierarchy
from mpm_ref.hot.multigrid.projectors import block_diagonal, diagonal_blocks, onto_range

from ..common.registry import experiment
from .linear_system import Frozen, frozen
from .measured_cg import Until, cg, convergence_factor
from .one_step import after
from .stiffness import bar
from .warm_states import begun, steps

WAYS = {
    "masked": "prolongations masked",
    "leaking": "identity blocks of 1 kg where nodes are held, nothing masked",
    "leaking-scaled": "the same, blocks of the mean diagonal",
}
LEVELS = (2, 3)
CAP = 800           # iterations of CG
FINE = 1e-14        # reduction at which the extreme eigenvalues have been found
STEPS = 3           # of the bar, before
SCENES = ("faceless", "twist")


class Held(NamedTuple):
    """The matrix of a step with n nodes, held ones among them."""

    A: sp.bsr_array         # (n d, n d)  rows and columns of held nodes are zero [kg]
    index: np.ndarray       # (n, d)      world indices
    free: np.ndarray        # (n,)        whether a node is free
    system: Frozen          # of the free nodes


class Found(NamedTuple):
    """What a cycle was seen to do."""

    coarsest: int           # nodes on the coarsest level
    factor: float           # per cycle, on its own
    iterations: int         # of CG
    converged: bool


def held(step):
    """`Held` of a `Step` at its start."""
    system = step.stepper.system(step.pose)
    A, (_, g) = system.matrix(system.start), system.evaluate(system.start)
    return with_held(A, system.index, -g, sum(len(body.id) for body in step.bodies))


def with_held(A, index, b, particles):
    """`Held` of a matrix, as `frozen`."""
    free = onto_range(diagonal_blocks(A)).any(axis=(1, 2))
    return Held(A, index, free, frozen(A, index, b, particles))


def cycle(given, way, levels):
    """The hierarchy of a way of WAYS, its coarsest level solved exactly. What has no zero rows is
    masked nowhere.
    """
    A, d = given.A, given.index.shape[1]
    if way != "masked":
        size = 1.0 if way == "leaking" else mean_diagonal(given)
        A = sp.bsr_array(A + block_diagonal(size * np.eye(d) * ~given.free[:, None, None]))
        A.sort_indices()
    return hierarchy(A, given.index, levels, implementation="scipy", coarsest="direct")


def mean_diagonal(given):
    """Of the free nodes [kg]."""
    return float(given.system.A.diagonal().mean())


def on_free(given, grids):
    """One cycle as r -> u, both over free nodes (m, d): what it does to held ones is dropped."""
    def inverse(r):
        whole = np.zeros(given.index.shape)
        whole[given.free] = r
        return grids.cycle(whole)[given.free]
    return inverse


def found(given, way, levels, rough):
    """`Found` of a way; the spectrum is seen by CG for a field rough (m, d) on the free nodes: in
    the step's own gradient slow modes may be faint.
    """
    grids = cycle(given, way, levels)
    inverse = on_free(given, grids)
    course = cg(given.system, inverse, Until(cap=CAP))
    longer = cg(given.system._replace(b=rough), inverse, Until(FINE, CAP))
    return Found(len(grids.levels[-1].index), convergence_factor(longer), course.iterations,
                 course.converged)


def matrices(dx, moduli, scenes):
    """(name, `Held`) of the twisted bar at some moduli of its middle, and of scenes of `BEGUN`."""
    for E in moduli:
        step = after(bar(dx, E, "hot", STEPS), STEPS)
        yield f"bar.E{E:.0e}".replace("e+0", "e"), held(step)
    for name in scenes:
        yield name, held(next(steps(*begun(name, "quick"), 1)))


@experiment("hot.held_nodes", title="Held nodes masked out of coarse levels, or leaking into them",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def held_nodes(run):
    """Factors and CG iterations on matrices with many held nodes."""
    cases = matrices(*run.choose(quick=(0.04, (1e5,), ()), standard=(0.03, (1e5, 1e9), SCENES)))
    rows = []
    for name, given in cases:
        rough = run.rng.standard_normal(given.system.b.shape)
        for levels in LEVELS:
            every = {way: found(given, way, levels, rough) for way in run.progress(WAYS, name)}
            record_ways(run, f"hot.held_nodes.{name}.levels{levels}", given, every)
            rows += [(name, levels, way, *f) for way, f in every.items()]
    run.table("cycles", ("matrix", "levels", "way", *Found._fields), rows)


def record_ways(run, target, given, every):
    """The factor of every way."""
    n = len(given.index)
    scale = (f"{given.system.particles} particles, {n} nodes, {n - given.free.sum()} held; mean "
             f"diagonal {mean_diagonal(given):.3g} kg")
    for way, f in every.items():
        missed = "" if f.converged else ", the cap, and not there"
        run.record(f"{target}.{way}", f.factor, comparator="info", scale=scale,
                   note=f"{WAYS[way]}; 1 - {1.0 - f.factor:.3e} per cycle, the coarsest of "
                        f"{f.coarsest} nodes solved exactly; {f.iterations} CG iterations to 1e-6"
                        + missed)
