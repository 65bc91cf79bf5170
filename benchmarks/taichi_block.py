"""Step the block with Taichi, as its users would write it: fields and an atomic scatter."""

import numpy as np
import taichi as ti

from .problem import GRAVITY, WALL

POLAR_ITERATIONS = 5


@ti.func
def polar(A):
    """Return the rotation of A by Newton's iteration."""
    R = A
    for _ in ti.static(range(POLAR_ITERATIONS)):
        R = 0.5 * (R + R.inverse().transpose())
    return R


@ti.func
def weights(f):
    """Return the quadratic splines at the three nodes of every axis."""
    return [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2]


@ti.data_oriented
class TaichiBlock:
    """A stepper of a `Block` on a number of threads."""

    name = "taichi"

    def __init__(self, block, threads):
        ti.init(arch=ti.cpu, default_fp=ti.f64, cpu_max_num_threads=threads, log_level=ti.ERROR)
        n_particles = len(block.x)
        self.m, self.V0, self.n, self.dx, self.dt, self.mu, self.lam = block[3:]
        self.x = ti.Vector.field(3, float, n_particles)
        self.v = ti.Vector.field(3, float, n_particles)
        self.C = ti.Matrix.field(3, 3, float, n_particles)
        self.F = ti.Matrix.field(3, 3, float, n_particles)
        self.grid_v = ti.Vector.field(3, float, (block.n,) * 3)
        self.grid_m = ti.field(float, (block.n,) * 3)
        initial = (block.x, block.v, np.zeros_like(block.F), block.F)
        for field, values in zip((self.x, self.v, self.C, self.F), initial, strict=True):
            field.from_numpy(values)

    def step(self, steps):
        """Advance by a number of steps."""
        for _ in range(steps):
            self.clear()
            self.p2g()
            self.update()
            self.g2p()
        ti.sync()

    def velocity(self):
        """Return the velocities (N, 3)."""
        return self.v.to_numpy()

    @ti.func
    def stress(self, F):
        """Return the Kirchhoff stress of fixed corotated elasticity."""
        J = F.determinant()
        volume = ti.Matrix.identity(float, 3) * (self.lam * J * (J - 1.0))
        return 2.0 * self.mu * (F - polar(F)) @ F.transpose() + volume

    @ti.kernel
    def clear(self):
        """Set masses and momenta of the grid to zero."""
        for i in ti.grouped(self.grid_m):
            self.grid_m[i] = 0.0
            self.grid_v[i] = [0.0, 0.0, 0.0]

    @ti.kernel
    def p2g(self):
        """Scatter mass and momentum, with the impulse of internal forces."""
        for p in self.x:
            base = int(self.x[p] / self.dx - 0.5)
            f = self.x[p] / self.dx - base
            w = weights(f)
            Q = self.m * self.C[p]
            Q -= self.dt * self.V0 * 4.0 / self.dx**2 * self.stress(self.F[p])
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                offset = ti.Vector([i, j, k])
                r = (offset - f) * self.dx
                weight = w[i][0] * w[j][1] * w[k][2]
                self.grid_v[base + offset] += weight * (self.m * self.v[p] + Q @ r)
                self.grid_m[base + offset] += weight * self.m

    @ti.kernel
    def update(self):
        """Compute the velocities of nodes with gravity and walls."""
        for i in ti.grouped(self.grid_m):
            if self.grid_m[i] > 0.0:
                u = self.grid_v[i] / self.grid_m[i]
                u[2] += self.dt * GRAVITY
                for a in ti.static(range(3)):
                    if (i[a] < WALL and u[a] < 0.0) or (i[a] > self.n - WALL and u[a] > 0.0):
                        u[a] = 0.0
                self.grid_v[i] = u

    @ti.kernel
    def g2p(self):
        """Update velocity, affine field, position and deformation of the particles."""
        for p in self.x:
            base = int(self.x[p] / self.dx - 0.5)
            f = self.x[p] / self.dx - base
            w = weights(f)
            v = ti.Vector.zero(float, 3)
            B = ti.Matrix.zero(float, 3, 3)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                offset = ti.Vector([i, j, k])
                u = w[i][0] * w[j][1] * w[k][2] * self.grid_v[base + offset]
                v += u
                B += u.outer_product((offset - f) * self.dx)
            self.v[p] = v
            self.C[p] = 4.0 / self.dx**2 * B
            self.x[p] += self.dt * v
            self.F[p] = (ti.Matrix.identity(float, 3) + self.dt * self.C[p]) @ self.F[p]
