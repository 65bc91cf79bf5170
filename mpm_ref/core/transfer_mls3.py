"""The transfer most scenes use, written for speed: MLS form, quadratic splines, 3D.

The same sums as `scatter_mls` and `gather_mls` of `transfer`, 2.5 times as fast for three reasons:

* Three nodes along the last axis, a line, hold nine consecutive numbers: a 3 x 3 matrix with a row
  for each node. The 27 nodes are nine lines, which differ by factors only, so that all sums over
  the first two axes are sums of matrices, for which the compiler uses vector registers.
* The momentum that a particle brings to a node is affine in the node's position: from line to line
  it grows by a constant.
* Indices are unsigned. With signed ones Numba provides for counting from the end, entry by entry,
  and the entries of a line are no longer known to be consecutive.
"""

from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .lines import _1, _2, _3, _4, _5, _6, _7, _8, node_number, strides
from .state import affine, body_force, full, put_affine
from .stencil import inverse_inertia, locate, weights_per_axis
from .tensor import lin, mlin, mul, mv, outer, put_vec, transpose, vec, vm


def fits(grid, stencil, mls):
    """Return whether a transfer is the one of this file: forces join the momenta at once."""
    return mls and grid.m.ndim == 3 and len(stencil) == 3 and grid.f.ndim == 1


@kernel
def scatter_mls3(particles, grid, stencil, dt, members):
    """`scatter_mls` for a quadratic stencil in 3D."""
    m, v = grid.m.reshape(-1), grid.v.reshape(-1)
    n = strides(grid.m)
    for p in members:
        base, s = locate(vec(particles.x, p, grid.m.shape), grid, stencil)
        w = weights_per_axis(s, stencil)
        mv_0, Q = affine_momentum(particles, p, s, grid, stencil, dt)
        first, dx_mv, dy_mv = momenta(mv_0, Q, w[2])
        i = node_number(base, n)
        for a in range(3):
            line, j = first, i
            for b in range(3):
                w_ab = w[0][a] * w[1][b]
                add_masses(m, j, w_ab * particles.m[p], w[2])
                add_momenta(v, _3 * j, w_ab, line)
                line, j = mlin(1.0, line, 1.0, dy_mv), j + n[1]
            first, i = mlin(1.0, first, 1.0, dx_mv), i + n[0]


@kernel
def gather_mls3(particles, grid, stencil, dt, bounds):
    """`gather_mls` for a quadratic stencil in 3D."""
    v = grid.v.reshape(-1)
    n = strides(grid.m)
    for p in range(bounds[0], bounds[1]):
        x = vec(particles.x, p, grid.m.shape)
        base, s = locate(x, grid, stencil)
        w = weights_per_axis(s, stencil)
        r = moments(w[0], s[0]), moments(w[1], s[1]), moments(w[2], s[2])
        i = node_number(base, n)
        A, rA = plane(v, i, n[1], w[1], r[1])
        B, rB = plane(v, i + n[0], n[1], w[1], r[1])
        C, rC = plane(v, i + n[0] + n[0], n[1], w[1], r[1])
        line = weighted(w[0], A, B, C)
        v_p = vm(w[2], line)
        r_x, r_y = weighted(r[0], A, B, C), weighted(w[0], rA, rB, rC)
        rv = transpose((vm(w[2], r_x), vm(w[2], r_y), vm(r[2], line)))
        put_vec(particles.v, p, v_p)
        put_vec(particles.x, p, lin(1.0, x, dt, v_p))
        put_affine(particles.C, p, grid.dx * inverse_inertia(grid.dx, stencil), rv)


@kernel
def affine_momentum(particles, p, s, grid, stencil, dt):
    """Momentum at the base node, and Q_p dx, its growth from node to node along each axis."""
    m, C, tau = particles.m[p], affine(particles.C, p, s), full(particles.tau, p, s)
    V = dt * inverse_inertia(grid.dx, stencil) * particles.V0[p]
    Q = mlin(m * grid.dx, C, -V * grid.dx, tau)
    mv_p = lin(m, vec(particles.v, p, s), m * dt, body_force(particles.b, p, s))
    return lin(1.0, mv_p, -1.0, mv(Q, s)), Q


@kernel
def momenta(mv_0, Q, w):
    """Momenta of the first line's nodes, times their weights along it, and their growth by axis."""
    x, y, z = transpose(Q)
    line = outer(w, mv_0)
    along = outer((0.0, w[1], 2.0 * w[2]), z)
    return mlin(1.0, line, 1.0, along), outer(w, x), outer(w, y)


@kernel
def add_masses(m, i, mass, w):
    """m += mass w at the three nodes from i on; all are read before any is written, as vectors."""
    a, b, c = m[i] + mass * w[0], m[i + _1] + mass * w[1], m[i + _2] + mass * w[2]
    m[i], m[i + _1], m[i + _2] = a, b, c


@kernel
def line_of(v, i):
    """The nine numbers from i on as a matrix."""
    return (
        (v[i], v[i + _1], v[i + _2]),
        (v[i + _3], v[i + _4], v[i + _5]),
        (v[i + _6], v[i + _7], v[i + _8]),
    )


@kernel
def add_momenta(v, i, w, line):
    """The nine numbers from i on += w line."""
    a, b, c = mlin(1.0, line_of(v, i), w, line)
    v[i], v[i + _1], v[i + _2] = a
    v[i + _3], v[i + _4], v[i + _5] = b
    v[i + _6], v[i + _7], v[i + _8] = c


@kernel
def moments(w, s):
    """w_k (k - s) along one axis."""
    return mul(w, (0.0 - s, 1.0 - s, 2.0 - s))


@kernel
def plane(v, i, n, w, r):
    """Sums of the three lines from node i on, n nodes apart, with the weights w and with r."""
    a, b, c = line_of(v, _3 * i), line_of(v, _3 * (i + n)), line_of(v, _3 * (i + n + n))
    return weighted(w, a, b, c), weighted(r, a, b, c)


@kernel
def weighted(w, A, B, C):
    """w_0 A + w_1 B + w_2 C of matrices."""
    return mlin(1.0, mlin(w[0], A, w[1], B), w[2], C)


@parallel_if_many
def scatter_mls3_color(particles, grid, stencil, dt, slabs, color):
    """`scatter_mls3` for the slabs of one colour, in parallel."""
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        scatter_mls3(particles, grid, stencil, dt, members)


@parallel_if_many
def gather_mls3_all(particles, grid, stencil, dt):
    """`gather_mls3` for all particles, in parallel."""
    for c in prange(CHUNKS):
        gather_mls3(particles, grid, stencil, dt, chunk(c, len(particles.x)))
