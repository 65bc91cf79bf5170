"""The gradient of a loss of the block by Taichi's tape, as its users would write it: fields of all
steps, for particles and nodes, since the tape reads the values of each step on its way back.

The rotation in the stress comes of a fixed number of Newton's iterations, which Taichi
differentiates; it refuses its singular value decomposition.
"""

import numpy as np
import taichi as ti

from .problem import GRAVITY, WALL
from .taichi_block import polar, weights


@ti.func
def stress(F, mu, lam):
    """Return the Kirchhoff stress of fixed corotated elasticity."""
    J = F.determinant()
    volume = ti.Matrix.identity(float, 3) * (lam * J * (J - 1.0))
    return 2.0 * mu * (F - polar(F)) @ F.transpose() + volume


@ti.data_oriented
class TaichiGradient:
    """Runs a `LossOfRun` forward and backward on a number of threads."""

    name = "taichi"

    def __init__(self, problem, threads):
        ti.init(arch=ti.cpu, default_fp=ti.f64, cpu_max_num_threads=threads, log_level=ti.ERROR)
        self.block, _, self.steps = problem
        self.count = len(self.block.x)
        self.m, self.V0, self.n, self.dx, self.dt, self.mu, self.lam = self.block[3:]
        states, grids = (self.steps + 1, self.count), (self.steps, *(self.n,) * 3)
        self.x = ti.Vector.field(3, float, states, needs_grad=True)
        self.v = ti.Vector.field(3, float, states, needs_grad=True)
        self.C = ti.Matrix.field(3, 3, float, states, needs_grad=True)
        self.F = ti.Matrix.field(3, 3, float, states, needs_grad=True)
        self.grid_p = ti.Vector.field(3, float, grids, needs_grad=True)
        self.grid_m = ti.field(float, grids, needs_grad=True)
        self.grid_v = ti.Vector.field(3, float, grids, needs_grad=True)
        self.w = ti.Vector.field(3, float, self.count)
        self.w.from_numpy(problem.w)
        self.loss = ti.field(float, (), needs_grad=True)

    def gradient(self):
        """Return the loss [m], and its gradients by the initial x and v, (N, 3) each."""
        self.start(self.block.x, self.block.v, self.block.F)
        self.grid_p.fill(0.0)
        self.grid_m.fill(0.0)
        with ti.ad.Tape(self.loss):
            for s in range(self.steps):
                self.p2g(s)
                self.update(s)
                self.g2p(s)
            self.measure()
        x_bar, v_bar = np.empty_like(self.block.x), np.empty_like(self.block.v)
        self.copy_gradient(x_bar, v_bar)
        return self.loss[None], x_bar, v_bar

    @ti.kernel
    def start(self, x: ti.types.ndarray(), v: ti.types.ndarray(), F: ti.types.ndarray()):
        """Set the state before the first step."""
        for p in range(self.count):
            for a in ti.static(range(3)):
                self.x[0, p][a] = x[p, a]
                self.v[0, p][a] = v[p, a]
                for b in ti.static(range(3)):
                    self.F[0, p][a, b] = F[p, a, b]
                    self.C[0, p][a, b] = 0.0

    @ti.kernel
    def copy_gradient(self, x_bar: ti.types.ndarray(), v_bar: ti.types.ndarray()):
        """Copy the gradients by the initial x and v."""
        for p in range(self.count):
            for a in ti.static(range(3)):
                x_bar[p, a] = self.x.grad[0, p][a]
                v_bar[p, a] = self.v.grad[0, p][a]

    @ti.kernel
    def p2g(self, s: int):
        """Scatter mass and momentum of step s, with the impulse of internal forces."""
        for p in range(self.count):
            base = int(self.x[s, p] / self.dx - 0.5)
            f = self.x[s, p] / self.dx - base
            w = weights(f)
            Q = self.m * self.C[s, p]
            Q -= self.dt * self.V0 * 4.0 / self.dx**2 * stress(self.F[s, p], self.mu, self.lam)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                r = (ti.Vector([i, j, k]) - f) * self.dx
                weight = w[i][0] * w[j][1] * w[k][2]
                node = s, base[0] + i, base[1] + j, base[2] + k
                self.grid_p[node] += weight * (self.m * self.v[s, p] + Q @ r)
                self.grid_m[node] += weight * self.m

    @ti.kernel
    def update(self, s: int):
        """Compute the velocities of the nodes of step s with gravity and walls."""
        for i, j, k in ti.ndrange(self.n, self.n, self.n):
            if self.grid_m[s, i, j, k] > 0.0:
                u = self.grid_p[s, i, j, k] / self.grid_m[s, i, j, k]
                u[2] += self.dt * GRAVITY
                node = ti.Vector([i, j, k])
                for a in ti.static(range(3)):
                    low, high = node[a] < WALL, node[a] > self.n - WALL
                    if (low and u[a] < 0.0) or (high and u[a] > 0.0):
                        u[a] = 0.0
                self.grid_v[s, i, j, k] = u

    @ti.kernel
    def g2p(self, s: int):
        """Compute the state of the particles after step s."""
        for p in range(self.count):
            base = int(self.x[s, p] / self.dx - 0.5)
            f = self.x[s, p] / self.dx - base
            w = weights(f)
            v = ti.Vector.zero(float, 3)
            B = ti.Matrix.zero(float, 3, 3)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                node = s, base[0] + i, base[1] + j, base[2] + k
                u = w[i][0] * w[j][1] * w[k][2] * self.grid_v[node]
                v += u
                B += u.outer_product((ti.Vector([i, j, k]) - f) * self.dx)
            C = 4.0 / self.dx**2 * B
            self.v[s + 1, p] = v
            self.C[s + 1, p] = C
            self.x[s + 1, p] = self.x[s, p] + self.dt * v
            self.F[s + 1, p] = (ti.Matrix.identity(float, 3) + self.dt * C) @ self.F[s, p]

    @ti.kernel
    def measure(self):
        """Add up the loss."""
        for p in range(self.count):
            self.loss[None] += self.w[p].dot(self.x[self.steps, p])
