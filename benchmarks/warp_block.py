"""Step the block with Warp, as its users would write it; its CPU backend uses one thread."""

import warp as wp

from .problem import GRAVITY, WALL

POLAR_ITERATIONS = 5


@wp.struct
class Constants:
    """Numbers of a `Block`."""

    m: wp.float64
    V0: wp.float64
    dx: wp.float64
    dt: wp.float64
    mu: wp.float64
    lam: wp.float64
    g: wp.float64
    n: wp.int32
    wall: wp.int32


@wp.struct
class State:
    """Arrays of particles and grid."""

    x: wp.array(dtype=wp.vec3d)
    v: wp.array(dtype=wp.vec3d)
    C: wp.array(dtype=wp.mat33d)
    F: wp.array(dtype=wp.mat33d)
    grid_v: wp.array(dtype=wp.vec3d, ndim=3)
    grid_m: wp.array(dtype=wp.float64, ndim=3)


@wp.func
def polar(A: wp.mat33d):
    """Return the rotation of A by Newton's iteration."""
    R = A
    for _ in range(POLAR_ITERATIONS):
        R = wp.float64(0.5) * (R + wp.transpose(wp.inverse(R)))
    return R


@wp.func
def weights(f: wp.float64):
    """Return the quadratic spline at the three nodes."""
    a = wp.float64(1.5) - f
    b = f - wp.float64(1.0)
    c = f - wp.float64(0.5)
    return wp.vec3d(wp.float64(0.5) * a * a, wp.float64(0.75) - b * b, wp.float64(0.5) * c * c)


@wp.func
def base_of(x: wp.float64, dx: wp.float64):
    """Return the index of the first node of the stencil at x."""
    return wp.int32(x / dx - wp.float64(0.5))


@wp.func
def arm(i: wp.int32, j: wp.int32, l: wp.int32, f: wp.vec3d, dx: wp.float64):
    """Return x_i - x_p."""
    return (wp.vec3d(wp.float64(i), wp.float64(j), wp.float64(l)) - f) * dx


@wp.kernel
def p2g(a: State, k: Constants):
    """Scatter mass and momentum, with the impulse of internal forces."""
    p = wp.tid()
    bx = base_of(a.x[p][0], k.dx)
    by = base_of(a.x[p][1], k.dx)
    bz = base_of(a.x[p][2], k.dx)
    f = a.x[p] / k.dx - wp.vec3d(wp.float64(bx), wp.float64(by), wp.float64(bz))
    wx = weights(f[0])
    wy = weights(f[1])
    wz = weights(f[2])
    J = wp.determinant(a.F[p])
    tau = wp.float64(2.0) * k.mu * (a.F[p] - polar(a.F[p])) * wp.transpose(a.F[p])
    tau += k.lam * J * (J - wp.float64(1.0)) * wp.identity(n=3, dtype=wp.float64)
    Q = k.m * a.C[p] - k.dt * k.V0 * wp.float64(4.0) / (k.dx * k.dx) * tau
    for i in range(3):
        for j in range(3):
            for l in range(3):
                r = arm(i, j, l, f, k.dx)
                w = wx[i] * wy[j] * wz[l]
                wp.atomic_add(a.grid_v, bx + i, by + j, bz + l, w * (k.m * a.v[p] + Q * r))
                wp.atomic_add(a.grid_m, bx + i, by + j, bz + l, w * k.m)


@wp.func
def apply_wall(u: wp.float64, i: wp.int32, n: wp.int32, wall: wp.int32):
    """Return a velocity component after the slip walls of its axis."""
    if i < wall and u < wp.float64(0.0):
        return wp.float64(0.0)
    if i > n - wall and u > wp.float64(0.0):
        return wp.float64(0.0)
    return u


@wp.kernel
def update(a: State, k: Constants):
    """Compute the velocities of nodes with gravity and walls."""
    i, j, l = wp.tid()
    if a.grid_m[i, j, l] > wp.float64(0.0):
        u = a.grid_v[i, j, l] / a.grid_m[i, j, l]
        w = u[2] + k.dt * k.g
        a.grid_v[i, j, l] = wp.vec3d(
            apply_wall(u[0], i, k.n, k.wall),
            apply_wall(u[1], j, k.n, k.wall),
            apply_wall(w, l, k.n, k.wall),
        )


@wp.kernel
def g2p(a: State, k: Constants):
    """Update velocity, affine field, position and deformation of the particles."""
    p = wp.tid()
    bx = base_of(a.x[p][0], k.dx)
    by = base_of(a.x[p][1], k.dx)
    bz = base_of(a.x[p][2], k.dx)
    f = a.x[p] / k.dx - wp.vec3d(wp.float64(bx), wp.float64(by), wp.float64(bz))
    wx = weights(f[0])
    wy = weights(f[1])
    wz = weights(f[2])
    new_v = wp.vec3d()
    B = wp.mat33d()
    for i in range(3):
        for j in range(3):
            for l in range(3):
                u = wx[i] * wy[j] * wz[l] * a.grid_v[bx + i, by + j, bz + l]
                r = arm(i, j, l, f, k.dx)
                new_v += u
                B += wp.outer(u, r)
    a.v[p] = new_v
    a.C[p] = wp.float64(4.0) / (k.dx * k.dx) * B
    a.x[p] = a.x[p] + k.dt * new_v
    a.F[p] = (wp.identity(n=3, dtype=wp.float64) + k.dt * a.C[p]) * a.F[p]


class WarpBlock:
    """A stepper of a `Block` on Warp's CPU device."""

    name = "warp"

    def __init__(self, block, threads):
        wp.config.quiet = True
        wp.init()
        self.a = State()
        self.a.x = wp.array(block.x, dtype=wp.vec3d, device="cpu")
        self.a.v = wp.array(block.v, dtype=wp.vec3d, device="cpu")
        self.a.C = wp.zeros(len(block.x), dtype=wp.mat33d, device="cpu")
        self.a.F = wp.array(block.F, dtype=wp.mat33d, device="cpu")
        self.a.grid_v = wp.zeros((block.n,) * 3, dtype=wp.vec3d, device="cpu")
        self.a.grid_m = wp.zeros((block.n,) * 3, dtype=wp.float64, device="cpu")
        self.k = Constants()
        for name in ("m", "V0", "dx", "dt", "mu", "lam", "n"):
            setattr(self.k, name, getattr(block, name))
        self.k.g, self.k.wall = GRAVITY, WALL

    def step(self, steps):
        """Advance by a number of steps."""
        n = len(self.a.x)
        phases = ((p2g, n), (update, self.a.grid_m.shape), (g2p, n))
        for _ in range(steps):
            self.a.grid_v.zero_()
            self.a.grid_m.zero_()
            for phase, size in phases:
                wp.launch(phase, size, [self.a, self.k], device="cpu")

    def velocity(self):
        """Return the velocities (N, 3)."""
        return self.a.v.numpy()
