"""One matrix, many preconditioners: CG with our V-cycle, with one-level methods, and with pyamg's.

The matrix is the projected Hessian at the start of a step of the twisted bar. Times are CPU seconds
of one thread, the better of two where that is quick; assembly is not in them, set-up is. The cost
of a new matrix with its hierarchy is given in V-cycles and in iterations of CG (HOT-cost).
"""

from contextlib import contextmanager
from math import log
from time import process_time
from typing import NamedTuple

import numba
import numpy as np
import pyamg
import scipy.sparse as sp
import threadpoolctl

from mpm_ref.core.jit import set_threads
from mpm_ref.hot.krylov import CGOptions, block_jacobi, pcg, scalar_jacobi
from mpm_ref.hot.linearization import matrix_product
from mpm_ref.hot.multigrid.blocks import hierarchy as block_hierarchy
from mpm_ref.hot.multigrid.blocks.sweep import Sweep, sweep
from mpm_ref.hot.multigrid.hierarchy import hierarchy
from mpm_ref.hot.multigrid.projectors import diagonal_blocks

from ..common.registry import experiment
from .linear_system import CGLimits, cg, convergence_factor, rigid_modes, twisted
from .one_step import step_after
from .stiffness import bar

OURS = "cycle-3-direct"         # what times are relative to
LONG = 1.0                      # CPU seconds after which a solve is not repeated
STIFF = 1e9                     # modulus of the claim [Pa]
GAIN = 5.0                      # over smoothed aggregation, the claim
CYCLES = 2.0                    # of two grids over smoothed aggregation's, the claim
REPEATS = 3                     # of the parts of a rebuild, and of its units
RUN = 50                        # V-cycles, and iterations of CG, that are timed together


def gauss_seidel(system):
    """Return one symmetric sweep by block kernels."""
    level, = block_hierarchy.build(system.A, system.index, 1, "linear")
    split = block_hierarchy.BlockGaussSeidel(level).split

    def inverse(r):
        state = Sweep(np.empty_like(r), np.zeros_like(r), np.empty_like(r))
        sweep(split, r, state)
        return state.u
    return inverse


def cycle(levels, coarsest, kernel="linear"):
    """Return our V-cycle; coarsest "pcg" is HOT's, to half the energy norm (HOT-sec5.3-coarse)."""
    return lambda s: hierarchy(s.A, s.index, levels, kernel, coarsest=coarsest).cycle


def aggregation(modes=None, **options):
    """Return pyamg's smoothed aggregation for the near null space modes(index), or constants."""
    def preconditioner(s):
        B = None if modes is None else modes(s.index)
        return by_pyamg(pyamg.smoothed_aggregation_solver(sp.bsr_matrix(s.A), B=B, **options))
    return preconditioner


def ruge_stuben(s):
    """Return pyamg's classical multigrid, which knows scalars only."""
    return by_pyamg(pyamg.ruge_stuben_solver(sp.csr_matrix(s.A)))


def by_pyamg(solver):
    """Return one V-cycle of pyamg as r (n, d) -> (n, d)."""
    matvec = solver.aspreconditioner().matvec
    return lambda r: matvec(r.reshape(-1)).reshape(r.shape)


_SWEEP = ("block_gauss_seidel", {"sweep": "symmetric", "blocksize": 3})
# Exact modes need no improvement: without it set-up is quicker, and iterations are as many.
_RIGID = {"modes": rigid_modes, "improve_candidates": None, "presmoother": _SWEEP,
          "postsmoother": _SWEEP}
CASES = {
    "jacobi-scalar": lambda s: scalar_jacobi(s.D),
    "jacobi-block": lambda s: block_jacobi(s.D),
    "gauss-seidel": gauss_seidel,
    "cycle-3-pcg": cycle(3, "pcg"),
    "cycle-3-pcg-flexible": cycle(3, "pcg"),
    OURS: cycle(3, "direct"),
    "cycle-4-direct": cycle(4, "direct"),
    "cycle-3-direct-quadratic": cycle(3, "direct", "quadratic"),
    "aggregation-rigid": aggregation(**_RIGID),
    "aggregation-constants": aggregation(),
    "ruge-stuben": ruge_stuben,
}
TWO_GRIDS = {"cycle": cycle(2, "direct"), "aggregation": aggregation(max_levels=2, **_RIGID)}


class PreconditionerCost(NamedTuple):
    """The work of a solve of a case."""

    iterations: int
    converged: bool
    setup: float            # CPU seconds
    solve: float            # CPU seconds

    @property
    def total(self):
        """Return the CPU seconds of set-up and solve."""
        return self.setup + self.solve


class Price(NamedTuple):
    """CPU seconds of the parts of HOT's multigrid."""

    matrix: float           # projected Hessian, with the tangents of all particles
    hierarchy: float        # from that matrix
    cycle: float            # one V-cycle
    iteration: float        # one of CG with Jacobi

    @property
    def rebuild(self):
        """Return the CPU seconds of a new matrix and its hierarchy."""
        return self.matrix + self.hierarchy


@contextmanager
def one_thread():
    """Run kernels and linear algebra on one thread, as pyamg does."""
    before = numba.get_num_threads()
    set_threads(1)
    try:
        with threadpoolctl.threadpool_limits(1):
            yield
    finally:
        set_threads(before)


def cost(system, case, limits):
    """Return the `PreconditionerCost` of a case."""
    start = process_time()
    inverse = CASES[case](system)
    ready = process_time()
    history = cg(system, inverse, limits, case.endswith("flexible"))
    return PreconditionerCost(history.iterations, history.converged, ready - start,
                              process_time() - ready)


def best(system, case, limits):
    """Return the cheaper cost of two, or of one that takes long."""
    first = cost(system, case, limits)
    return first if first.total > LONG else min(first, cost(system, case, limits),
                                                key=lambda c: c.total)


def least(work):
    """Return the result of work(), and the CPU seconds of the quickest of `REPEATS`."""
    seconds = []
    for _ in range(REPEATS):
        start = process_time()
        result = work()
        seconds.append(process_time() - start)
    return result, min(seconds)


def price(step):
    """Return the `Price` at the start of a step, of the hierarchy that HOT and PN-MGPCG take."""
    def system():
        return step.stepper.system(step.pose)       # a new one, still without a matrix

    dv, index = system().start, system().index
    b = -system().evaluate(dv)[1]
    A, matrix = least(lambda: system().matrix(dv))
    grids, setup = least(lambda: hierarchy(A, index))
    product, inverse = matrix_product(A), block_jacobi(diagonal_blocks(A))
    _, cycles = least(lambda: [grids.cycle(b) for _ in range(RUN)])
    solution, iterations = least(
        lambda: pcg(product, b, inverse, CGOptions(lambda size: 0.0, RUN)))
    return Price(matrix, setup, cycles / RUN, iterations / solution.iterations)


def two_grids(system):
    """Return {cycle: convergence factor} of two levels, the coarser solved exactly."""
    return {name: convergence_factor(cg(system, make(system), CGLimits(1e-10, 2000)))
            for name, make in TWO_GRIDS.items()}


@experiment("hot.preconditioners", title="CG on one matrix: our V-cycle, one-level methods, pyamg",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 1800})
def preconditioners(run):
    """Record sweeps of the middle's modulus, and of the number of particles at one modulus."""
    coarse, steps, cap = run.choose(quick=(0.03, 3, 1000), standard=(0.03, 6, 2000))
    moduli = run.choose(quick=(1e5, 1e9), standard=tuple(10.0**k for k in range(5, 11)))
    finer = run.choose(quick=(), standard=((0.02, STIFF), (0.0135, 1e5), (0.0135, STIFF)))
    np.random.seed(run.seed)        # noqa: NPY002  pyamg draws from it to estimate eigenvalues
    rows = []
    with one_thread():
        warm_up(coarse)
        for dx, E in run.progress([*((coarse, E) for E in moduli), *finer], "matrices"):
            system = twisted(dx, E, steps)
            costs = {case: best(system, case, CGLimits(cap=cap)) for case in CASES}
            record_costs(run, system, E, costs)
            if dx == coarse:
                record_two_grids(run, system, E)
            rows += [(E, system.particles, len(system.index), case, *c, c.total / costs[OURS].total)
                     for case, c in costs.items()]
        record_price(run, min(dx for dx, _ in ((coarse, STIFF), *finer)), steps)
    columns = ("E", "particles", "nodes", "case", *PreconditionerCost._fields, "ratio")
    run.table("costs", columns, rows)


def record_price(run, dx, steps):
    """Record a rebuild over a V-cycle, and over an iteration of CG with Jacobi."""
    step = step_after(bar(dx, STIFF, "hot", steps), steps)
    p = price(step)
    scale = (f"{step.particles} particles, {len(step.pose.unknowns.m)} "
             f"nodes, middle {STIFF:.0e} Pa")
    parts = (f"CPU time; matrix {p.matrix:.3f} s, hierarchy {p.hierarchy:.3f} s, V-cycle "
            f"{1e3 * p.cycle:.1f} ms, iteration {1e3 * p.iteration:.2f} ms")
    run.record("hot.sec5.rebuild_vs_vcycle", p.rebuild / p.cycle, scale=scale, note=f"{parts}; the "
               f"hierarchy alone takes {p.hierarchy / p.cycle:.1f} V-cycles, and the print may "
               "leave out the finest matrix")
    run.record("hot.sec5.rebuild_vs_pcg", p.rebuild / p.iteration, scale=scale, note=parts)


def warm_up(dx):
    """Compile the kernels of the cases."""
    system = twisted(dx, 1e5, 1)
    for case in CASES:
        cost(system, case, CGLimits(cap=2))


def target_prefix(system, E):
    """Return the leading part of the targets of a matrix."""
    return f"hot.preconditioners.{system.particles}.E{E:.0e}".replace("e+0", "e").replace("+", "")


def scale_text(system, E):
    """Return the scale of a matrix as text."""
    return f"{system.particles} particles, {len(system.index)} free nodes, middle {E:.0e} Pa"


def record_costs(run, system, E, costs):
    """Record the total time of every case over ours, and the claim on smoothed aggregation."""
    name, scale, ours = target_prefix(system, E), scale_text(system, E), costs[OURS]
    for case, c in costs.items():
        run.record(f"{name}.{case}.time", c.total / ours.total, comparator="info", scale=scale,
                   note=f"set-up {c.setup:.3f} s, {c.iterations} iterations {c.solve:.3f} s, over "
                   f"{ours.total:.3f} s of ours" + ("" if c.converged else "; not converged"))
    theirs = min(c.total for case, c in costs.items() if case.startswith("aggregation"))
    claimed = {"comparator": ">=", "bound": GAIN} if E == STIFF else {"comparator": "info"}
    run.record(f"{name}.gain", theirs / ours.total, scale=scale, **claimed,
               note="time of CG with pyamg's quicker smoothed aggregation over that with our "
               "V-cycle, set-up included")


def record_two_grids(run, system, E):
    """Record convergence factors of two grids, and the cycles of ours over theirs."""
    name, scale = f"{target_prefix(system, E)}.two-grids", scale_text(system, E)
    factors = two_grids(system)
    for cycle_, factor in factors.items():
        run.record(f"{name}.{cycle_}.factor", factor, comparator="info", scale=scale,
                   note=f"1 - {1.0 - factor:.2e}; per cycle, from CG's Ritz values")
    run.record(f"{name}.cycles", log(factors["aggregation"]) / log(factors["cycle"]),
               comparator="<=", bound=CYCLES, scale=scale,
               note="cycles for an equal reduction, ours over smoothed aggregation's")
