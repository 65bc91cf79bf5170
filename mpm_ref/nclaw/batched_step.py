"""One step of many bodies that never meet, each on a grid of its own, and its adjoint.

Training runs the segments of a trajectory at once (NCLAW-train). The step is that of `explicit`
with the settings of NCLAW-sim, MLS-MPM with quadratic splines in a box of walls, but for two
things: it takes the stress from outside, and leaves the trial deformation gradient as it is. Bodies
share out the threads; each is stepped by one, so that results do not depend on how many there are.
"""

from typing import NamedTuple

import numpy as np

from ..core.adjoint.grid import Update, update_bars
from ..core.adjoint.transfer import Moved
from ..core.adjoint.transfer_mls3 import gather_bars_mls3, scatter_bars_mls3
from ..core.jit import kernel, parallel, prange
from ..core.spline import STENCILS, base_of
from ..core.state import NO_HISTORY, NONE, Grid, Particles
from ..core.tensor import identity, mat, mlin, mm, put_mat, transpose
from ..core.transfer_mls3 import gather_mls3, scatter_mls3

QUADRATIC = STENCILS[2]
LIKE = (0, 1, 2)       # any tuple of length 3
UNKNOWN = np.empty((0, 0, 0, 0))      # a stress that is not


class World(NamedTuple):
    """Where bodies move (NCLAW-sim); 3D."""

    dx: float               # [m]
    dt: float               # [s]
    gravity: np.ndarray     # (3,) [m/s^2]
    eps: float              # [kg] added to the nodes' masses
    low: np.ndarray         # (3,) nodes of lower index are in a wall that lets go, ...
    high: np.ndarray        # ... those of higher index too; integer
    lower: np.ndarray       # (3,) positions are clipped to [lower, upper] [m]
    upper: np.ndarray
    m: np.ndarray           # (n,) masses of the particles of a body [kg]
    V0: np.ndarray          # (n,) volumes at rest [m^3]


class States(NamedTuple):
    """What the particles of b bodies carry, n each; or the gradients of it.

    The stress is that of a step's start; where it ends none is known, and tau is empty.
    """

    x: np.ndarray       # (b, n, 3)    [m]
    v: np.ndarray       # (b, n, 3)    [m/s]
    C: np.ndarray       # (b, n, 3, 3) [1/s]
    F: np.ndarray       # (b, n, 3, 3)
    tau: np.ndarray = UNKNOWN   # (b, n, 3, 3) [Pa]


ROWS = States((3,), (3,), (3, 3), (3, 3), (3, 3))       # shapes of one particle's


class BatchNodes(NamedTuple):
    """Storage of a grid for each of b bodies, flat, and of its bars; reused from step to step."""

    m: np.ndarray           # (b, most nodes)
    v: np.ndarray           # (b, 3 most nodes)
    m_bar: np.ndarray
    v_bar: np.ndarray


def make_world(problem):
    """`World` of a problem of one body. Raises ValueError for what is not as in NCLAW-sim."""
    walls, clip, scheme = getattr(problem.conditions, "walls", None), problem.clip, problem.scheme
    if problem.dim != 3 or (scheme.transfer, scheme.degree, scheme.rpic) != ("mls", 2, 0.0):
        raise ValueError(f"{problem.title!r}: expected MLS-MPM with quadratic splines in 3D, "
                         "without damping")
    if len(problem.bodies) != 1 or problem.clock.dt is None:
        raise ValueError(f"{problem.title!r}: expected one body and a fixed dt")
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
    """Whether walls are those of NCLAW-sim: six that let go and do not rub."""
    return (walls is not None and walls.kind == "separate" and not walls.friction
            and None not in (*walls.low, *walls.high))


def make_nodes(of, count):
    """`BatchNodes` for so many bodies in a `World`."""
    return BatchNodes(*(np.empty((count, k * max_nodes(of))) for k in (1, 3, 1, 3)))


def max_nodes(of):
    """How many nodes a body can reach."""
    return int(np.prod(np.ceil((of.upper - of.lower) / of.dx) + len(QUADRATIC)))


def advance(of, before, on):
    """`States` after a step; F is (I + dt C) F. Raises ValueError for positions that are not finite
    or beyond the clip, and for arrays of other shapes than the world's.
    """
    require_fit(of, on, before)
    after = States(*(np.empty_like(a) for a in before[:4]))
    _advance(of, before, after, on)
    return after


def pull_back(of, before, after, bars, on):
    """The gradients before a step from those after it, `States` both. Raises as `advance` does."""
    require_fit(of, on, before, after, bars)
    found = States(*(np.empty_like(a) for a in before))
    _pull_back(of, before, after, bars, found, on)
    return found


def require_fit(of, on, before, *beside):
    """Raise ValueError where kernels would read or write beside arrays: those of `States` before a
    step, of what is carried after it or its gradients (`beside`), and of `BatchNodes`.
    """
    require_shapes(of, before, len(before.x))
    for states in beside:
        require_shapes(of, states[:4], len(before.x))
    require_nodes(of, on, len(before.x))
    require_inside(of, before.x)


def require_shapes(of, arrays, bodies):
    """Raise ValueError unless arrays in the order of `States` are of so many bodies."""
    for name, a, row in zip(States._fields, arrays, ROWS):
        expected = (bodies, len(of.m), *row)
        if a.shape != expected:
            raise ValueError(f"{name} has shape {a.shape}, expected {expected}: bodies, particles "
                             "of each, axes; is it of another body, or left out?")


def require_nodes(of, on, bodies):
    """Raise ValueError unless `BatchNodes` hold so many bodies of a `World`."""
    most = max_nodes(of)
    if len(on.m) < bodies or on.m.shape[1] < most:
        raise ValueError(f"storage for {len(on.m)} bodies of {on.m.shape[1]} nodes, expected at "
                         f"least {bodies} of {most}; make it with `make_nodes` of this world")


def require_inside(of, x):
    """Raise ValueError unless positions are where the grid is."""
    if not (np.all(x >= of.lower) and np.all(x <= of.upper)):
        b, p = np.argwhere(~np.all((x >= of.lower) & (x <= of.upper), axis=-1))[0]
        raise ValueError(f"particle {p} of body {b} is at {x[b, p]}, expected it between "
                         f"{of.lower} and {of.upper} m; has the law made the run unstable?")


@kernel
def reached_box(of, x):
    """The first node that particles at x (n, 3) reach, and how many there are along each axis."""
    first, shape = np.empty(3, np.int64), np.empty(3, np.int64)
    for a in range(3):
        low = high = x[0, a]
        for p in range(len(x)):
            low, high = min(low, x[p, a]), max(high, x[p, a])
        first[a] = base_of(low, of.dx, QUADRATIC)
        shape[a] = base_of(high, of.dx, QUADRATIC) + len(QUADRATIC) - first[a]
    return first, (shape[0], shape[1], shape[2])


@kernel
def body_grid(of, m, v, at):
    """`Grid` of zeros in the storage of one body; at = (first node, shape)."""
    first, (nx, ny, nz) = at
    size = nx * ny * nz
    m[:size] = 0.0
    v[:3 * size] = 0.0
    return Grid(m[:size].reshape((nx, ny, nz)), v[:3 * size].reshape((nx, ny, nz, 3)), NONE, NONE,
                first, of.dx)


@kernel
def scatter_velocities(of, particles, grid):
    """Masses and velocities of the nodes, as they are before the walls."""
    scatter_mls3(particles, grid, QUADRATIC, of.dt, np.arange(len(of.m)))
    m, v = grid.m.reshape(-1), grid.v.reshape(-1, 3)
    for i in range(len(m)):
        if m[i] > 0.0:
            for a in range(3):
                v[i, a] = v[i, a] / (m[i] + of.eps) + of.dt * of.gravity[a]


@kernel
def stop_at_walls(of, grid, held):
    """Zero, in an array like the velocities, those that go into walls."""
    for a in range(3):
        stop_along(a, of.low[a] - grid.origin[a], of.high[a] - grid.origin[a], grid.v, held)


@kernel
def stop_along(a, low, high, v, held):
    """Zero, of nodes below low or above high along axis a, what moves on that way."""
    for i in range(v.shape[0]):
        for j in range(v.shape[1]):
            for k in range(v.shape[2]):
                index = i if a == 0 else j if a == 1 else k
                if (index < low and v[i, j, k, a] < 0.0) or (index > high and v[i, j, k, a] > 0.0):
                    held[i, j, k, a] = 0.0


@kernel
def particles_of(of, states, tau, b):
    """`Particles` of body b."""
    C = states.C[b]
    return Particles(states.x[b], states.v[b], C, C, states.F[b], tau, of.m, of.V0, NO_HISTORY,
                     NONE)


@kernel
def advance_one(of, before, after, on, b):
    """The step of body b."""
    grid, tau = body_grid(of, on.m[b], on.v[b], reached_box(of, before.x[b])), before.tau[b]
    scatter_velocities(of, particles_of(of, before, tau, b), grid)
    stop_at_walls(of, grid, grid.v)
    moved = particles_of(of, after, tau, b)
    moved.x[:] = before.x[b]
    gather_mls3(moved, grid, QUADRATIC, of.dt, (0, len(of.m)))
    for p in range(len(of.m)):
        for a in range(3):
            moved.x[p, a] = min(max(moved.x[p, a], of.lower[a]), of.upper[a])
        grown = mlin(1.0, identity(LIKE), of.dt, mat(moved.C, p, LIKE))
        put_mat(moved.F, p, mm(grown, mat(before.F[b], p, LIKE)))


@kernel
def pull_back_one(of, before, after, bars, found, where):
    """The adjoint of the step of a body, where = (`BatchNodes`, its number)."""
    on, b = where
    at, particles = reached_box(of, before.x[b]), particles_of(of, before, before.tau[b], b)
    grid, bar = body_grid(of, on.m[b], on.v[b], at), body_grid(of, on.m_bar[b], on.v_bar[b], at)
    scatter_velocities(of, particles, grid)
    unread = np.zeros(len(of.m))
    mine = Particles(found.x[b], found.v[b], found.C[b], NONE, found.F[b], found.tau[b], unread,
                     unread, NO_HISTORY, NONE)
    u = pull_deformation(of, before, after, bars, mine, b)
    free = grid.v.copy()
    stop_at_walls(of, grid, free)
    stopped = Grid(grid.m, free, NONE, NONE, grid.origin, of.dx)
    scatter_bars_mls3(Moved(particles.x, u), stopped, mine, bar, QUADRATIC, np.arange(len(of.m)))
    stop_at_walls(of, grid, bar.v)
    update_one(of, grid, bar)
    gather_bars_mls3(particles, bar, mine, QUADRATIC, of.dt, (0, len(of.m)))


@kernel
def pull_deformation(of, before, after, bars, mine, b):
    """Start the bars of body b: of F before, of C after and of x; returns those of v."""
    n = len(of.m)
    u = np.empty((n, 3))
    for p in range(n):
        G, F = mat(bars.F[b], p, LIKE), mat(before.F[b], p, LIKE)
        C = mat(after.C[b], p, LIKE)
        put_mat(mine.F, p, mm(transpose(mlin(1.0, identity(LIKE), of.dt, C)), G))
        put_mat(mine.C, p, mlin(1.0, mat(bars.C[b], p, LIKE), of.dt, mm(G, transpose(F))))
        for a in range(3):
            free = of.lower[a] < after.x[b, p, a] < of.upper[a]
            mine.x[p, a] = bars.x[b, p, a] if free else 0.0
            mine.v[p, a] = 0.0
            u[p, a] = bars.v[b, p, a] + of.dt * mine.x[p, a]
    return u


@kernel
def update_one(of, grid, bar):
    """The adjoint of the update of one grid."""
    flat = Grid(grid.m.reshape(-1), grid.v.reshape(-1, 3), NONE, NONE, grid.origin, of.dx)
    bars = Grid(bar.m.reshape(-1), bar.v.reshape(-1, 3), NONE, NONE, grid.origin, of.dx)
    update_bars(flat, bars, of.gravity, Update(of.dt, of.eps, False), np.zeros(3), (0, len(flat.m)))


@parallel
def _advance(of, before, after, on):
    for b in prange(len(before.x)):
        advance_one(of, before, after, on, b)


@parallel
def _pull_back(of, before, after, bars, found, on):
    for b in prange(len(before.x)):
        pull_back_one(of, before, after, bars, found, (on, b))
