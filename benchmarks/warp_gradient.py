"""The gradient of a loss of the block by Warp's tape, as its users would write it: arrays of all
steps, for particles and nodes, since the tape reads the values of each step on its way back.

The rotation in the stress comes of a fixed number of Newton's iterations, which Warp
differentiates; the gradient through its singular value decomposition is wrong at F = I, and loses
digits near it.
"""

import warp as wp

from .problem import GRAVITY, WALL
from .warp_block import Constants, apply_wall, arm, base_of, polar, weights


@wp.struct
class Particles:
    """State of the particles before or after a step."""

    x: wp.array(dtype=wp.vec3d)
    v: wp.array(dtype=wp.vec3d)
    C: wp.array(dtype=wp.mat33d)
    F: wp.array(dtype=wp.mat33d)


@wp.struct
class Nodes:
    """Momentum, mass and new velocity of the nodes of a step."""

    p: wp.array(dtype=wp.vec3d, ndim=3)
    m: wp.array(dtype=wp.float64, ndim=3)
    v: wp.array(dtype=wp.vec3d, ndim=3)


@wp.kernel
def p2g(a: Particles, nodes: Nodes, k: Constants):
    """Scatter mass and momentum, with the impulse of internal forces."""
    p = wp.tid()
    x = a.x[p]
    bx = base_of(x[0], k.dx)
    by = base_of(x[1], k.dx)
    bz = base_of(x[2], k.dx)
    f = x / k.dx - wp.vec3d(wp.float64(bx), wp.float64(by), wp.float64(bz))
    wx = weights(f[0])
    wy = weights(f[1])
    wz = weights(f[2])
    F = a.F[p]
    J = wp.determinant(F)
    shear = wp.float64(2.0) * k.mu * (F - polar(F)) * wp.transpose(F)
    tau = shear + k.lam * J * (J - wp.float64(1.0)) * wp.identity(n=3, dtype=wp.float64)
    Q = k.m * a.C[p] - k.dt * k.V0 * wp.float64(4.0) / (k.dx * k.dx) * tau
    momentum = k.m * a.v[p]
    for i in range(3):
        for j in range(3):
            for l in range(3):
                r = arm(i, j, l, f, k.dx)
                w = wx[i] * wy[j] * wz[l]
                wp.atomic_add(nodes.p, bx + i, by + j, bz + l, w * (momentum + Q * r))
                wp.atomic_add(nodes.m, bx + i, by + j, bz + l, w * k.m)


@wp.kernel
def update(nodes: Nodes, k: Constants):
    """Compute the velocities of nodes with gravity and walls."""
    i, j, l = wp.tid()
    if nodes.m[i, j, l] > wp.float64(0.0):
        u = nodes.p[i, j, l] / nodes.m[i, j, l]
        w = u[2] + k.dt * k.g
        nodes.v[i, j, l] = wp.vec3d(
            apply_wall(u[0], i, k.n, k.wall),
            apply_wall(u[1], j, k.n, k.wall),
            apply_wall(w, l, k.n, k.wall),
        )


@wp.kernel
def g2p(a: Particles, nodes: Nodes, after: Particles, k: Constants):
    """Compute the state of the particles after a step."""
    p = wp.tid()
    x = a.x[p]
    bx = base_of(x[0], k.dx)
    by = base_of(x[1], k.dx)
    bz = base_of(x[2], k.dx)
    f = x / k.dx - wp.vec3d(wp.float64(bx), wp.float64(by), wp.float64(bz))
    wx = weights(f[0])
    wy = weights(f[1])
    wz = weights(f[2])
    v = wp.vec3d()
    B = wp.mat33d()
    for i in range(3):
        for j in range(3):
            for l in range(3):
                u = wx[i] * wy[j] * wz[l] * nodes.v[bx + i, by + j, bz + l]
                r = arm(i, j, l, f, k.dx)
                v += u
                B += wp.outer(u, r)
    C = wp.float64(4.0) / (k.dx * k.dx) * B
    after.v[p] = v
    after.C[p] = C
    after.x[p] = x + k.dt * v
    after.F[p] = (wp.identity(n=3, dtype=wp.float64) + k.dt * C) * a.F[p]


@wp.kernel
def measure(a: Particles, w: wp.array(dtype=wp.vec3d), loss: wp.array(dtype=wp.float64)):
    """Add up the loss."""
    p = wp.tid()
    wp.atomic_add(loss, 0, wp.dot(w[p], a.x[p]))


class WarpGradient:
    """Runs a `LossOfRun` forward and backward on Warp's CPU device, which has one thread."""

    name = "warp"

    def __init__(self, problem, threads):
        wp.config.quiet = True
        wp.init()
        self.block, w, steps = problem
        self.count, self.shape = len(self.block.x), (self.block.n,) * 3
        self.states = [make_particles(self.count) for _ in range(steps + 1)]
        self.grids = [make_nodes(self.shape) for _ in range(steps)]
        self.w = wp.array(w, dtype=wp.vec3d, device="cpu")
        self.loss = zeros(1, wp.float64)
        self.k = Constants()
        for name in ("m", "V0", "dx", "dt", "mu", "lam", "n"):
            setattr(self.k, name, getattr(self.block, name))
        self.k.g, self.k.wall = GRAVITY, WALL

    def gradient(self):
        """Return the loss [m], and its gradients by the initial x and v, (N, 3) each."""
        first, last = self.states[0], self.states[-1]
        for name in ("x", "v", "F"):
            getattr(first, name).assign(getattr(self.block, name))
        for nodes in self.grids:
            nodes.p.zero_()
            nodes.m.zero_()
        self.loss.zero_()
        tape = wp.Tape()
        with tape:
            for a, nodes, after in zip(self.states[:-1], self.grids, self.states[1:], strict=True):
                wp.launch(p2g, self.count, [a, nodes, self.k], device="cpu")
                wp.launch(update, self.shape, [nodes, self.k], device="cpu")
                wp.launch(g2p, self.count, [a, nodes, after, self.k], device="cpu")
            wp.launch(measure, self.count, [last, self.w, self.loss], device="cpu")
        tape.backward(self.loss)
        x_bar, v_bar = first.x.grad.numpy().copy(), first.v.grad.numpy().copy()
        loss = float(self.loss.numpy()[0])
        tape.zero()
        return loss, x_bar, v_bar


def zeros(shape, dtype):
    """Return an array of zeros that has a gradient."""
    return wp.zeros(shape, dtype=dtype, device="cpu", requires_grad=True)


def make_particles(count):
    """Return the arrays of a state."""
    a = Particles()
    a.x, a.v = zeros(count, wp.vec3d), zeros(count, wp.vec3d)
    a.C, a.F = zeros(count, wp.mat33d), zeros(count, wp.mat33d)
    return a


def make_nodes(shape):
    """Return the arrays of the nodes of a step."""
    nodes = Nodes()
    nodes.p, nodes.m = zeros(shape, wp.vec3d), zeros(shape, wp.float64)
    nodes.v = zeros(shape, wp.vec3d)
    return nodes
