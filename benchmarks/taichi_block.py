"""The block in Taichi, as a user of Taichi would write it: grid and particle fields, atomic
scatter.
"""

import numpy as np
import taichi as ti

from .problem import GRAVITY, WALL

POLAR_ITERATIONS = 5


class TaichiBlock:
    """Steps a `Block`. ti.init is called once per process with the number of threads."""

    name = "taichi"

    def __init__(self, block, threads):
        ti.init(arch=ti.cpu, default_fp=ti.f64, cpu_max_num_threads=threads, log_level=ti.ERROR)
        self.fields = make(block)
        self.advance = kernels(block, self.fields)

    def step(self, steps):
        """Advance by a number of steps."""
        for _ in range(steps):
            for phase in self.advance:
                phase()
        ti.sync()

    def velocity(self):
        """Velocities (N, 3)."""
        return self.fields["v"].to_numpy()


def make(block):
    """Fields with the initial state."""
    n_particles = len(block.x)
    fields = {
        "x": ti.Vector.field(3, float, n_particles),
        "v": ti.Vector.field(3, float, n_particles),
        "C": ti.Matrix.field(3, 3, float, n_particles),
        "F": ti.Matrix.field(3, 3, float, n_particles),
        "grid_v": ti.Vector.field(3, float, (block.n,) * 3),
        "grid_m": ti.field(float, (block.n,) * 3),
    }
    fields["x"].from_numpy(block.x)
    fields["v"].from_numpy(block.v)
    fields["C"].from_numpy(np.zeros_like(block.F))
    fields["F"].from_numpy(block.F)
    return fields


def kernels(block, fields):
    """The phases of a step, in order."""
    x, v, C, F = (fields[k] for k in "xvCF")
    grid_v, grid_m = fields["grid_v"], fields["grid_m"]
    m, V0, n, dx, dt, mu, lam = (float(a) for a in block[3:])
    n = block.n
    inv_dx = 1.0 / dx

    @ti.func
    def polar(A):
        R = A
        for _ in ti.static(range(POLAR_ITERATIONS)):
            R = 0.5 * (R + R.inverse().transpose())
        return R

    @ti.kernel
    def clear():
        for i in ti.grouped(grid_m):
            grid_m[i] = 0.0
            grid_v[i] = [0.0, 0.0, 0.0]

    @ti.kernel
    def p2g():
        for p in x:
            base = int(x[p] * inv_dx - 0.5)
            f = x[p] * inv_dx - base
            w = [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2]
            J = F[p].determinant()
            tau = 2.0 * mu * (F[p] - polar(F[p])) @ F[p].transpose()
            tau += ti.Matrix.identity(float, 3) * (lam * J * (J - 1.0))
            Q = m * C[p] - dt * V0 * 4.0 * inv_dx * inv_dx * tau
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                offset = ti.Vector([i, j, k])
                r = (offset - f) * dx
                weight = w[i][0] * w[j][1] * w[k][2]
                grid_v[base + offset] += weight * (m * v[p] + Q @ r)
                grid_m[base + offset] += weight * m

    @ti.kernel
    def update():
        for i in ti.grouped(grid_m):
            if grid_m[i] > 0.0:
                u = grid_v[i] / grid_m[i]
                u[2] += dt * GRAVITY
                for a in ti.static(range(3)):
                    if (i[a] < WALL and u[a] < 0.0) or (i[a] > n - WALL and u[a] > 0.0):
                        u[a] = 0.0
                grid_v[i] = u

    @ti.kernel
    def g2p():
        for p in x:
            base = int(x[p] * inv_dx - 0.5)
            f = x[p] * inv_dx - base
            w = [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2]
            new_v = ti.Vector.zero(float, 3)
            B = ti.Matrix.zero(float, 3, 3)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                offset = ti.Vector([i, j, k])
                weight = w[i][0] * w[j][1] * w[k][2]
                u = weight * grid_v[base + offset]
                new_v += u
                B += u.outer_product((offset - f) * dx)
            v[p] = new_v
            C[p] = 4.0 * inv_dx * inv_dx * B
            x[p] += dt * new_v
            F[p] = (ti.Matrix.identity(float, 3) + dt * C[p]) @ F[p]

    return clear, p2g, update, g2p
