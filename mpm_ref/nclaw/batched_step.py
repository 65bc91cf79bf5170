"""One step of a batch of bodies that do not interact, each on its own grid, and its adjoint.

Training runs the segments of a trajectory at once (NCLAW-train). The step is that of `explicit`
with the settings of NCLAW-sim, MLS-MPM with quadratic splines in a box of walls, with two
differences: the stress is an input, and the output is the trial deformation gradient. Each body is
stepped by one thread, so that results do not depend on the number of threads.
"""

from typing import NamedTuple

import numpy as np

from ..core.adjoint.grid import Update, update_bars
from ..core.adjoint.transfer import Advection
from ..core.adjoint.transfer_mls3 import gather_bars_mls3, scatter_bars_mls3
from ..core.jit import kernel, parallel, prange
from ..core.spline import STENCILS, base_of
from ..core.state import NO_HISTORY, NONE, Grid, Particles
from ..core.tensor import identity, mat, mlin, mm, put_mat, transpose
from ..core.transfer_mls3 import gather_mls3, scatter_mls3

QUADRATIC = STENCILS[2]
LIKE = (0, 1, 2)       # any tuple of length 3
NO_STRESS = np.empty((0, 0, 0, 0))


class World(NamedTuple):
    """The data that all bodies share: grid, walls, gravity, masses and volumes (NCLAW-sim); 3D."""

    dx: float               # [m]
    dt: float               # [s]
    gravity: np.ndarray     # (3,) [m/s^2]
    eps: float              # [kg] added to the nodes' masses
    low: np.ndarray         # (3,) nodes of lower index are in a separable wall, ...
    high: np.ndarray        # ... those of higher index too; integer
    lower: np.ndarray       # (3,) positions are clipped to [lower, upper] [m]
    upper: np.ndarray
    m: np.ndarray           # (n,) masses of the particles of a body [kg]
    V0: np.ndarray          # (n,) volumes at rest [m^3]


class States(NamedTuple):
    """The states of the n particles of each of b bodies, or the gradients of states.

    The stress is an input of a step; in the states after it tau is empty.
    """

    x: np.ndarray       # (b, n, 3)    [m]
    v: np.ndarray       # (b, n, 3)    [m/s]
    C: np.ndarray       # (b, n, 3, 3) [1/s]
    F: np.ndarray       # (b, n, 3, 3)
    tau: np.ndarray = NO_STRESS   # (b, n, 3, 3) [Pa]


ROWS = States((3,), (3,), (3, 3), (3, 3), (3, 3))       # shapes for one particle


class BatchNodes(NamedTuple):
    """Storage for the grid of each of b bodies, flat, and for its bars; reused in every step."""

    m: np.ndarray           # (b, most nodes)
    v: np.ndarray           # (b, 3 most nodes)
    m_bar: np.ndarray
    v_bar: np.ndarray


def make_world(problem):
    """Return the `World` of a problem of one body. Raises ValueError for a problem with other
    features than those of NCLAW-sim.
    """
    walls, clip, scheme = getattr(problem.conditions, "walls", None), problem.clip, problem.scheme
    plain = scheme.one_gradient and not scheme.f_bar and scheme.precision == "double"
    if problem.dim != 3 or not plain or (scheme.degree, scheme.rpic) != (2, 0.0):
        raise ValueError(f"{problem.title!r}: expected MLS-MPM with quadratic splines in 3D, "
                         "in double precision, without damping, relaxation or averaged volumes "
                         "(f_bar)")
    flows = problem.sources or problem.sinks
    if len(problem.bodies) != 1 or flows or problem.clock.dt is None:
        raise ValueError(f"{problem.title!r}: expected one body, no source or sink, and a fixed dt")
    if clip is None or not is_nclaw_box(walls) or problem.conditions.parts:
        raise ValueError(f"{problem.title!r}: expected a box of walls of kind \"separate\" without "
                         "friction and a clip, nothing else")
    q = problem.bodies[0].particles
    if q.b.ndim > 1:
        raise ValueError(f"{problem.title!r}: expected no body force but gravity; its particles "
                         "have one each")
    return World(problem.dx, problem.clock.dt, np.asarray(problem.gravity, float), scheme.mass_eps,
                 np.array(walls.low), np.array(walls.high), np.asarray(clip[0], float),
                 np.asarray(clip[1], float), q.m, q.V0)


def is_nclaw_box(walls):
    """Return whether walls are those of NCLAW-sim: six, separable and without friction."""
    return (walls is not None and walls.kind == "separate" and not walls.friction
            and None not in (*walls.low, *walls.high))


def make_nodes(world, count):
    """Allocate `BatchNodes` for `count` bodies in a `World`."""
    return BatchNodes(*(np.empty((count, k * max_nodes(world))) for k in (1, 3, 1, 3)))


def max_nodes(world):
    """Return the largest number of nodes that a body can reach."""
    return int(np.prod(np.ceil((world.upper - world.lower) / world.dx) + len(QUADRATIC)))


def advance(world, states, nodes):
    """Return the `States` after a step; F is (I + dt C) F.

    states: `States` before it, with tau; nodes: `BatchNodes` for at least as many bodies. Raises
    ValueError for positions that are not finite or beyond the clip, and for arrays of other shapes
    than the world's.
    """
    require_fit(world, nodes, states)
    after = States(*(np.empty_like(a) for a in states[:4]))
    _advance(world, states, after, nodes)
    return after


def pull_back(world, before, after, bars, nodes):
    """Return the gradients before a step from those after it, `States` both; errors as of
    `advance`.
    """
    require_fit(world, nodes, before, after, bars)
    result = States(*(np.empty_like(a) for a in before))
    _pull_back(world, before, after, bars, result, nodes)
    return result


def require_fit(world, nodes, before, *others):
    """Raise ValueError where kernels would read or write past the ends of arrays: of the `States`
    before a step, of those after it and their gradients (`others`), and of `BatchNodes`.
    """
    require_shapes(world, before, len(before.x))
    for states in others:
        require_shapes(world, states[:4], len(before.x))
    require_nodes(world, nodes, len(before.x))
    require_inside(world, before.x)


def require_shapes(world, arrays, bodies):
    """Raise ValueError unless arrays in the order of `States` have the shapes of these bodies."""
    for name, a, row in zip(States._fields, arrays, ROWS):
        expected = (bodies, len(world.m), *row)
        if a.shape != expected:
            raise ValueError(f"{name} has shape {a.shape}, expected {expected}: bodies, particles "
                             "of each, axes; is it of another body, or left out?")


def require_nodes(world, nodes, bodies):
    """Raise ValueError unless `BatchNodes` suffice for a number of bodies in a `World`."""
    most = max_nodes(world)
    if len(nodes.m) < bodies or nodes.m.shape[1] < most:
        raise ValueError(f"storage for {len(nodes.m)} bodies of {nodes.m.shape[1]} nodes, expected "
                         f"at least {bodies} of {most}; make it with `make_nodes` of this world")


def require_inside(world, x):
    """Raise ValueError unless positions are where the grid is."""
    if not (np.all(x >= world.lower) and np.all(x <= world.upper)):
        b, p = np.argwhere(~np.all((x >= world.lower) & (x <= world.upper), axis=-1))[0]
        raise ValueError(f"particle {p} of body {b} is at {x[b, p]}, expected it between "
                         f"{world.lower} and {world.upper} m; has the law made the run unstable?")


@kernel
def reached_box(world, x):
    """Return the first node of particles at x (n, 3), and the number of nodes along each axis."""
    first, shape = np.empty(3, np.int64), np.empty(3, np.int64)
    for a in range(3):
        low = high = x[0, a]
        for p in range(len(x)):
            low, high = min(low, x[p, a]), max(high, x[p, a])
        first[a] = base_of(low, world.dx, QUADRATIC)
        shape[a] = base_of(high, world.dx, QUADRATIC) + len(QUADRATIC) - first[a]
    return first, (shape[0], shape[1], shape[2])


@kernel
def body_grid(world, m, v, region):
    """Return a `Grid` of zeros in the storage of one body; region = (first node, shape)."""
    first, (nx, ny, nz) = region
    size = nx * ny * nz
    m[:size] = 0.0
    v[:3 * size] = 0.0
    return Grid(m[:size].reshape((nx, ny, nz)), v[:3 * size].reshape((nx, ny, nz, 3)), NONE, NONE,
                first, world.dx)


@kernel
def scatter_velocities(world, particles, grid):
    """Compute the masses and velocities of the nodes before the wall conditions."""
    scatter_mls3(particles, grid, QUADRATIC, world.dt, np.arange(len(world.m)))
    m, v = grid.m.reshape(-1), grid.v.reshape(-1, 3)
    for i in range(len(m)):
        if m[i] > 0.0:
            for a in range(3):
                v[i, a] = v[i, a] / (m[i] + world.eps) + world.dt * world.gravity[a]


@kernel
def stop_at_walls(world, grid, masked):
    """Set entries of an array like the velocities to zero where velocities point into walls."""
    for a in range(3):
        stop_along(a, world.low[a] - grid.origin[a], world.high[a] - grid.origin[a], grid.v, masked)


@kernel
def stop_along(a, low, high, v, masked):
    """Set component a to zero where a node below low or above high moves farther out along a."""
    for i in range(v.shape[0]):
        for j in range(v.shape[1]):
            for k in range(v.shape[2]):
                index = i if a == 0 else j if a == 1 else k
                if (index < low and v[i, j, k, a] < 0.0) or (index > high and v[i, j, k, a] > 0.0):
                    masked[i, j, k, a] = 0.0


@kernel
def particles_of(world, states, tau, b):
    """Return the `Particles` of body b."""
    C = states.C[b]
    return Particles(states.x[b], states.v[b], C, C, states.F[b], tau, world.m, world.V0,
                     NO_HISTORY, NONE)


@kernel
def advance_one(world, before, after, nodes, b):
    """Make the step of body b."""
    grid = body_grid(world, nodes.m[b], nodes.v[b], reached_box(world, before.x[b]))
    tau = before.tau[b]
    scatter_velocities(world, particles_of(world, before, tau, b), grid)
    stop_at_walls(world, grid, grid.v)
    after_b = particles_of(world, after, tau, b)
    after_b.x[:] = before.x[b]
    gather_mls3(after_b, grid, QUADRATIC, world.dt, (0, len(world.m)))
    for p in range(len(world.m)):
        for a in range(3):
            after_b.x[p, a] = min(max(after_b.x[p, a], world.lower[a]), world.upper[a])
        grown = mlin(1.0, identity(LIKE), world.dt, mat(after_b.C, p, LIKE))
        put_mat(after_b.F, p, mm(grown, mat(before.F[b], p, LIKE)))


@kernel
def pull_back_one(world, before, after, bars, result, index):
    """Run the adjoint of the step of a body; index = (`BatchNodes`, its number)."""
    nodes, b = index
    region = reached_box(world, before.x[b])
    particles = particles_of(world, before, before.tau[b], b)
    grid = body_grid(world, nodes.m[b], nodes.v[b], region)
    bar = body_grid(world, nodes.m_bar[b], nodes.v_bar[b], region)
    scatter_velocities(world, particles, grid)
    unread = np.zeros(len(world.m))
    mine = Particles(result.x[b], result.v[b], result.C[b], NONE, result.F[b], result.tau[b],
                     unread, unread, NO_HISTORY, NONE)
    u = pull_deformation(world, before, after, bars, mine, b)
    free = grid.v.copy()
    stop_at_walls(world, grid, free)
    stopped = Grid(grid.m, free, NONE, NONE, grid.origin, world.dx)
    scatter_bars_mls3(Advection(particles.x, u, NONE), stopped, mine, bar, QUADRATIC,
                      np.arange(len(world.m)))
    stop_at_walls(world, grid, bar.v)
    update_one(world, grid, bar)
    gather_bars_mls3(particles, bar, mine, QUADRATIC, world.dt, (0, len(world.m)))


@kernel
def pull_deformation(world, before, after, bars, mine, b):
    """Start the bars of body b: of F before, of C after and of x; return those of v."""
    n = len(world.m)
    u = np.empty((n, 3))
    for p in range(n):
        G, F = mat(bars.F[b], p, LIKE), mat(before.F[b], p, LIKE)
        C = mat(after.C[b], p, LIKE)
        put_mat(mine.F, p, mm(transpose(mlin(1.0, identity(LIKE), world.dt, C)), G))
        put_mat(mine.C, p, mlin(1.0, mat(bars.C[b], p, LIKE), world.dt, mm(G, transpose(F))))
        for a in range(3):
            free = world.lower[a] < after.x[b, p, a] < world.upper[a]
            mine.x[p, a] = bars.x[b, p, a] if free else 0.0
            mine.v[p, a] = 0.0
            u[p, a] = bars.v[b, p, a] + world.dt * mine.x[p, a]
    return u


@kernel
def update_one(world, grid, bar):
    """Compute the adjoint of the update of one grid."""
    flat = Grid(grid.m.reshape(-1), grid.v.reshape(-1, 3), NONE, NONE, grid.origin, world.dx)
    bars = Grid(bar.m.reshape(-1), bar.v.reshape(-1, 3), NONE, NONE, grid.origin, world.dx)
    update_bars(flat, bars, world.gravity, Update(world.dt, world.eps, False), np.zeros(3),
                (0, len(flat.m)))


@parallel
def _advance(world, before, after, nodes):
    for b in prange(len(before.x)):
        advance_one(world, before, after, nodes, b)


@parallel
def _pull_back(world, before, after, bars, result, nodes):
    for b in prange(len(before.x)):
        pull_back_one(world, before, after, bars, result, (nodes, b))
