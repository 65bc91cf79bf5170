"""HOT by second implementations: the largest relative differences from the package.

The problem is a block on a lattice of 2^d particles a cell, strained and in motion. One side is
fixed; the far half is ten times stiffer. Both implementations get the same arrays. A difference is
the largest entry of the difference of two arrays over the largest entry of the second one's.
"""

import numpy as np

from mpm_ref.body import restore_order
from mpm_ref.constitutive import differential
from mpm_ref.hot.descent import line_search_steps
from mpm_ref.hot.lbfgs import LBFGS
from mpm_ref.hot.line_search import Iterate
from mpm_ref.hot.linearization import Linearization
from mpm_ref.hot.methods import RULES, minimise, printed
from mpm_ref.hot.multigrid.hierarchy import hierarchy
from mpm_ref.hot.multigrid.options import CycleOptions
from mpm_ref.hot.report import Profiler
from mpm_ref.materials import make_law
from mpm_ref.materials.principal import dpk1_spd
from mpm_ref.scene import problem_from_arrays

from ..common.registry import experiment
from . import characteristic_norm, galerkin, implicit_step, lbfgs_start, projected_hessian
from .agreement import difference

DX, DT, RHO0 = 0.1, 0.01, 1000.0
E, STIFFER, NU = 1e5, 10.0, 0.3
G = 9.8                                         # along the last axis, downwards [m/s^2]
SIDE = -3 * DX                                  # of the fixed nodes on the first axis [m]
CELLS = {2: (13, 5), 3: (9, 2, 1)}              # of the block: four slabs of nodes in 2D
SMALL = {2: (4, 3), 3: (3, 2, 2)}               # where a dense problem is minimised or assembled
METHODS = ("hot", "pn-pcg")
EPS = 1e-15                                     # tolerance of the package's solves
LEVELS, WINDOW, ITERATIONS = 3, 3, 10
FIELDS = 30                                     # random ones, on which V-cycles act
FACTORS = (1.0, 3.0)                            # of a V-cycle as first inverse of L-BFGS
DIRECT = CycleOptions(coarsest="direct")
INEXACT = CycleOptions(coarsest="pcg", preconditioner="scalar")
IMPLEMENTATIONS = ("blocks", "scipy")           # of multigrid in the package
STRETCHES = (1e-12, 1e-6, 1e-3, 0.5, 1.0, 2.0)  # lengths of the least stretch, of both signs
GAPS = (1e-2, 1e-4, 1e-6, 1e-8)                 # sums of the two least stretches


def lame(modulus):
    """Return mu and lam [Pa] of Young's modulus [Pa] and NU."""
    return modulus / (2.0 * (1.0 + NU)), modulus * NU / ((1.0 + NU) * (1.0 - 2.0 * NU))


def gravity(d):
    """Return the gravity (d,) [m/s^2]."""
    return -G * np.eye(d)[-1]


def block(cells):
    """Return the `ElasticParticles` of the block, and a mask (N,) of its stiff half."""
    d = len(cells)
    axes = [np.arange(2 * k) + 0.5 for k in cells]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d) * DX / 2 + SIDE
    rng = np.random.default_rng(d)
    F = np.eye(d) + 0.1 * rng.uniform(-1.0, 1.0, (len(x), d, d))
    C = rng.uniform(-2.0, 2.0, F.shape)
    v = (x - x.mean(axis=0)) @ np.linspace(-2.0, 2.5, d * d).reshape(d, d)
    V0 = np.full(len(x), (DX / 2) ** d)
    stiff = x[:, 0] > x[:, 0].mean()
    moduli = np.array(lame(E * np.where(stiff, STIFFER, 1.0)))
    return implicit_step.ElasticParticles(x, v, C, F, RHO0 * V0, V0, moduli), stiff


def stepper_of(cells, method, solver):
    """Return the package's stepper and bodies of the block, the soft half first."""
    particles, stiff = block(cells)
    bodies = {name: {"material": {"law": "fixed_corotated", "E": modulus, "nu": NU},
                     **{key: getattr(particles, key)[half] for key in ("x", "v", "C", "F", "m",
                                                                       "V0")}}
              for name, modulus, half in (("soft", E, ~stiff), ("stiff", STIFFER * E, stiff))}
    d = len(cells)
    side = {"type": "half_space", "point": (SIDE,) * d, "normal": tuple(np.eye(d)[0])}
    problem = problem_from_arrays(bodies, dx=DX, dt=DT, steps=1, gravity=tuple(gravity(d)),
                                  fixed=[{"region": side}], integrator=method, solver=solver)
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    return stepper, problem.bodies


def pose_and_system(cells):
    """Return the package's `ImplicitProblem` and `System` of a step of the block, from zero."""
    stepper, bodies = stepper_of(cells, "hot", {"start": "zero", "balance": "none"})
    pose = stepper.problem(bodies, 0.0, DT)
    return pose, stepper.system(pose)


def free_nodes(system):
    """Return the mask (n,) of the nodes whose block of the Hessian is not zero."""
    diagonal = system.matrix(system.start).diagonal()
    return diagonal.reshape(system.start.shape).all(axis=1)


def free_matrix(matrix, mask, d):
    """Return the rows and columns of the nodes of a mask (n,) of a matrix (n d, n d)."""
    entries = np.repeat(mask, d)
    return matrix[np.ix_(entries, entries)]


def step_difference(d, method):
    """Return the difference of velocities of nodes, and of all arrays of particles, in a step."""
    stepper, bodies = stepper_of(SMALL[d], method, {"eps": EPS})
    grid = stepper.step(bodies, 0.0, DT)
    before, stiff = block(SMALL[d])
    nodes, v, after = implicit_step.implicit_step(
        before, DX, DT, gravity(d), lambda nodes: nodes[:, 0] < SIDE + 0.5 * DX)
    place = tuple((np.rint(nodes / DX).astype(int) - grid.origin).T)
    differences = [difference(grid.v[place], v)]
    for name in ("x", "v", "C", "F"):
        start, end = getattr(before, name), getattr(after, name)
        package = np.empty_like(end)
        for body, half in zip(bodies, (~stiff, stiff), strict=True):
            package[half] = restore_order(getattr(body.particles, name), body.id)
        differences.append(difference(package - start, end - start))
    return max(differences)


def norm_difference(d):
    """Return the difference of the nodes' characteristic norms, and of a solve's first residual."""
    pose, system = pose_and_system(CELLS[d])
    particles, stiff = block(CELLS[d])
    w = characteristic_norm.weights(particles.x, DX * system.index, DX)
    soft_xi, stiff_xi = [characteristic_norm.rest_stiffness(*lame(modulus), d)
                         for modulus in (E, STIFFER * E)]
    kappa = characteristic_norm.characteristic_norms(
        w, particles.m, np.where(stiff, stiff_xi, soft_xi), DX, DT, d)
    g = system.evaluate(system.start)[1]
    report = minimise(system, printed("hot", max_iterations=1)).report
    return max(difference(pose.kappa, kappa),
               difference(report.residuals[0], characteristic_norm.residual(g, kappa)))


def cycles_of(grids, fields):
    """Return the package's V-cycles (n d, k) of fields (k, n, d)."""
    return np.stack([grids.cycle(b).ravel() for b in fields], axis=1)


def hierarchy_differences(d, implementation):
    """Return the difference of the coarse matrices, and that of a V-cycle.

    The V-cycle is the linear map with a direct solver of the coarsest level, of random fields, and
    the cycle with CG, as printed, of the first residual.
    """
    _, system = pose_and_system(CELLS[d])
    H, free = system.matrix(system.start), free_nodes(system)
    A = free_matrix(H.toarray(), free, d)
    levels = galerkin.hierarchy(A, system.index[free], LEVELS)
    direct, inexact = [hierarchy(H, system.index, LEVELS, implementation=implementation,
                                 **options._asdict()) for options in (DIRECT, INEXACT)]
    matrices = [difference(package.A.toarray(), level.A)
                for package, level in zip(direct.levels[1:], levels[1:], strict=True)]
    fields = np.random.default_rng(d).normal(size=(FIELDS, *free.shape, d)) * free[:, None]
    entries = np.repeat(free, d)
    columns = fields.reshape(FIELDS, -1).T[entries]
    cycle = difference(cycles_of(direct, fields)[entries],
                       galerkin.v_cycle(levels, columns, np.linalg.solve))
    b = -system.evaluate(system.start)[1]
    u = galerkin.v_cycle(levels, b[free].ravel(), galerkin.krylov)
    return max(matrices), max(cycle, difference(inexact.cycle(b)[free].ravel(), u))


def iterate_difference(d, factor):
    """Return the difference of ITERATIONS iterates of L-BFGS from `factor` times a V-cycle, and the
    number of halvings in the package's line searches.
    """
    _, system = pose_and_system(SMALL[d])
    start = system.start
    grids = hierarchy(system.matrix(start), system.index, LEVELS, **DIRECT._asdict())
    iterates = lbfgs_start.iterates(
        lambda u: system.energy(u.reshape(start.shape)),
        lambda u: system.evaluate(u.reshape(start.shape))[1].ravel(),
        factor * cycles_of(grids, np.eye(start.size).reshape(-1, *start.shape)),
        start.ravel(), WINDOW, ITERATIONS)
    method = LBFGS(lambda dv: Linearization(None, lambda r: factor * grids.cycle(r)), WINDOW)
    profiler = Profiler()
    advance = line_search_steps(system, method, RULES, profiler)
    package = [Iterate(start, *system.evaluate(start))]
    for _ in range(ITERATIONS):
        package.append(advance(package[-1])[0])
    dv = np.array([one.dv.ravel() for one in package])
    return difference(dv, iterates), profiler.report("hot", None).backtracks


def random_rotation(d, rng):
    """Return a random rotation (d, d)."""
    Q = np.linalg.qr(rng.normal(size=(d, d)))[0]
    return Q * [*np.ones(d - 1), np.linalg.det(Q)]


def gradient_of(stretches, rng):
    """Return a random F (d, d) with signed stretches (d,)."""
    d = len(stretches)
    return random_rotation(d, rng) @ np.diag(stretches) @ random_rotation(d, rng).T


def differential_difference(F):
    """Return the difference of d2psi/dF2, and of its positive part, at F (d, d)."""
    d, law = len(F), make_law("fixed_corotated", E=E, nu=NU)
    units = np.eye(d * d).reshape(-1, d, d)
    exact = differential(np.tile(F, (d * d, 1, 1)), units, law)
    positive = [dpk1_spd(tuple(map(tuple, F)), tuple(map(tuple, dF)), law) for dF in units]
    H = projected_hessian.hessian(F, *lame(E))
    return max(difference(exact.reshape(H.shape).T, H),
               difference(np.reshape(positive, H.shape).T, projected_hessian.positive_part(H)))


def hessian_difference(d):
    """Return the difference of derivatives of P where the least stretch is near or below zero."""
    rng = np.random.default_rng(d)
    others = (2.2, 2.1)[:d - 1]
    return max(differential_difference(gradient_of((*others, sign * s), rng))
               for s in STRETCHES for sign in (1.0, -1.0))


def passage_difference(d):
    """Return the difference of derivatives of P, times GAPS, on the way through inversion."""
    rng = np.random.default_rng(d)
    return max(gap * differential_difference(gradient_of((1.3, 0.8, gap - 0.8)[3 - d:], rng))
               for gap in GAPS)


def assembled_difference(d):
    """Return the difference of the assembled projected Hessian of a step at its start."""
    pose, system = pose_and_system(SMALL[d])
    particles, _ = block(SMALL[d])
    _, w, dw = implicit_step.weights(particles.x, DX)
    y = np.einsum("pba,pib->pia", particles.F, dw)
    F = particles.F + DT * np.einsum("ia,pib->pab", pose.unknowns.v + system.start, y)
    A = [DT**2 * V0 * projected_hessian.positive_part(projected_hessian.hessian(*one))
         for V0, *one in zip(particles.V0, F, *particles.moduli, strict=True)]
    H = projected_hessian.assembled(particles.m @ w, y, np.array(A))
    free = free_nodes(system)
    return difference(free_matrix(system.matrix(system.start).toarray(), free, d),
                      free_matrix(H, free, d))


def parts(d):
    """Yield each part of RECORDS in d dimensions and its largest difference."""
    yield "implicit_step", max(step_difference(d, method) for method in METHODS)
    yield "characteristic_norm", norm_difference(d)
    matrices, cycles = zip(*(hierarchy_differences(d, word) for word in IMPLEMENTATIONS),
                           strict=True)
    yield "galerkin", max(matrices)
    yield "galerkin.cycle", max(cycles)
    yield "lbfgs_start", max(iterate_difference(d, factor)[0] for factor in FACTORS)
    yield "projected_hessian", hessian_difference(d)
    yield "projected_hessian.passage", passage_difference(d)
    yield "projected_hessian.assembled", assembled_difference(d)


def sizes(cells):
    """Return the number of particles of blocks by their dimension, as a text."""
    return ", ".join(f"{d}D: {np.prod(k) * 2**d}" for d, k in cells.items()) + " particles"


RECORDS = {     # part: the largest difference that is allowed, the size, what is compared
    "implicit_step": (1e6 * EPS, f"{sizes(SMALL)}; 1 step", (
        f"velocities of nodes, x, v, C and F after a step by {' and '.join(METHODS)}, with the "
        "minimiser by SciPy from dense weights and complex steps. The bound is the solves' "
        f"tolerance {EPS:g} times 1e6: light nodes amplify what it leaves by about 1e5")),
    "characteristic_norm": (1e-13, sizes(CELLS), (
        "kappa of all nodes and the first residual of a solve, with dP/dF by complex steps and the "
        "surface of a convex hull. The bound is round-off of sums over a node's particles")),
    "galerkin": (1e-13, f"{sizes(CELLS)}; {LEVELS} levels", (
        f"coarse matrices of {' and '.join(IMPLEMENTATIONS)}, with dense products P^T A P. The "
        "bound is their round-off")),
    "galerkin.cycle": (1e-11, f"{sizes(CELLS)}; {LEVELS} levels", (
        f"V-cycles of {FIELDS} random fields, and of a residual with CG on the coarsest level, "
        "with a formula of dense matrices, without sweeps. The bound is round-off times 1e5; the "
        "matrices' condition is 7e6 at most")),
    "lbfgs_start": (1e-12, f"{sizes(SMALL)}; {ITERATIONS} iterations, {WINDOW} pairs", (
        f"iterates from V-cycles times {' and '.join(map(str, FACTORS))} as first inverse, with "
        "dense BFGS updates. The bound is round-off times 1e4, as differences of nearly equal "
        "gradients enter the updates")),
    "projected_hessian": (1e-13, f"2D and 3D, {2 * len(STRETCHES)} F each", (
        "d2psi/dF2 and its positive part, with eigenvalue derivatives of tr S, determinants and "
        "eigh; least stretches from -2 to 2. The bound is round-off over 0.1, the least sum of "
        "two stretches")),
    "projected_hessian.passage": (1e-13, f"2D and 3D, {len(GAPS)} F each", (
        f"differences times s = {GAPS[0]:g} to {GAPS[-1]:g}, the sum of the two least stretches: "
        "d2psi/dF2 has an eigenvalue of -4 mu/s there, and no value at s = 0, where the rotation "
        "is not unique")),
    "projected_hessian.assembled": (1e-13, f"{sizes(SMALL)}; start of a step", (
        "the projected Hessian of HOT-eq1 on free nodes, with dense products. The bound is "
        "round-off of sums over a node's particles")),
}


@experiment("independent.hot", title="Second implementations: HOT's step, norm, multigrid, L-BFGS",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 20})
def hot(run):
    """Record the largest difference of each part, in 2D and 3D."""
    dimensions = run.progress((2, 3), "dimensions")
    rows = [(part, d, value) for d in dimensions for part, value in parts(d)]
    run.table("parts", ("part", "d", "difference"), rows)
    for part, (bound, scale, note) in RECORDS.items():
        worst = max(value for name, _, value in rows if name == part)
        run.record(f"independent.hot.{part}", worst, comparator="<=", bound=bound, unit="1",
                   scale=scale, note=note, scatter=1.0)
