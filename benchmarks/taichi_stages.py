"""A step of MPM in Taichi, as its users would write it, with a field for every stage.

Kernels are written once for 2D and 3D: loops over axes and nodes of a stencil are static. What a
material needs is chosen when Taichi compiles them.
"""

import numpy as np
import taichi as ti

from .conformance_cases import double_svd

REALS = {"f32": ti.f32, "f64": ti.f64}


@ti.func
def splines(f):
    """Return the quadratic splines at the three nodes of every axis, f cells from the first."""
    return [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2]


@ti.func
def slopes(f):
    """Return the derivatives of `splines`."""
    return [f - 1.5, -2.0 * (f - 1.0), f - 0.5]


@ti.data_oriented
class TaichiStages:
    """Steps from a `Start`, in precision "f32" or "f64", on one thread.

    svd "library" is Taichi's singular value decomposition, "double" that of `double_svd`.
    """

    def __init__(self, start, precision, svd="library"):
        ti.init(arch=ti.cpu, default_fp=REALS[precision], cpu_max_num_threads=1,
                log_level=ti.ERROR)
        self.start, self.svd, self.dim, self.n = start, svd, start.dim, start.n
        self.is_fluid, self.is_mls = start.material == "fluid", start.transfer == "mls"
        self.gravity, self.normal = ti.Vector(list(start.gravity)), ti.Vector(list(start.normal))
        count = len(start.x)
        self.x, self.v, self.s = (ti.Vector.field(self.dim, float, count) for _ in range(3))
        self.C, self.L, self.F_trial, self.F, self.tau, self.U, self.V = (
            ti.Matrix.field(self.dim, self.dim, float, count) for _ in range(7))
        self.J, self.psi, self.m, self.V0 = (ti.field(float, count) for _ in range(4))
        self.base = ti.Vector.field(self.dim, int, count)
        self.w = ti.field(float, (count,) + (3,) * self.dim)
        grid = (self.n,) * self.dim
        self.grid_m, self.solid = ti.field(float, grid), ti.field(int, grid)
        self.grid_mv, self.grid_f, self.grid_v_free, self.grid_v = (
            ti.Vector.field(self.dim, float, grid) for _ in range(4))
        self.energy = ti.field(float, 3)
        self.solid.from_numpy(start.solid.astype(np.int32))
        for name in ("x", "v", "C", "m", "V0"):
            getattr(self, name).from_numpy(getattr(start, name))
        (self.J if self.is_fluid else self.F).from_numpy(start.F)
        self.update_stress(flows=False)

    def step(self):
        """Advance by a step and return its stages, as `oracle.write` takes them."""
        for field in (self.grid_m, self.grid_mv, self.grid_f, self.grid_v_free, self.grid_v,
                      self.energy):
            field.fill(0.0)
        self.p2g()
        self.accelerate()
        self.touch()
        self.g2p()
        self.deform()
        self.update_stress(flows=True)
        self.add_energies()
        fields = {"mass": self.grid_m, "momentum": self.grid_mv, "force": self.grid_f,
                  "velocity": self.grid_v_free, "velocity_bc": self.grid_v, "base": self.base,
                  "weights": self.w, "x": self.x, "v": self.v, "C": self.C, "L": self.L,
                  "tau": self.tau, "energy": self.energy}
        fields |= {"F": self.J} if self.is_fluid else {"F": self.F, "F_trial": self.F_trial}
        stages = {name: field.to_numpy() for name, field in fields.items()}
        stages["weights"] = stages["weights"].reshape(len(self.start.x), -1)
        if self.is_fluid:
            stages["tau"] = stages["tau"][:, 0, 0]
        return stages | {"origin": (0,) * self.dim}

    def update_stress(self, flows):
        """Compute the stress of the particles, after the return map of sand where it flows."""
        material = self.start.material
        if not self.is_fluid:
            self.decompose()
        if material == "sand" and flows:
            self.sand_return()
        {"jelly": self.jelly_stress, "sand": self.sand_stress, "fluid": self.fluid_stress}[
            material]()

    def decompose(self):
        """Decompose F of the particles."""
        if self.svd == "double":
            for field, values in zip((self.U, self.s, self.V), double_svd(self.F.to_numpy()),
                                     strict=True):
                field.from_numpy(values)
        else:
            self.library_svd()

    def rotations(self):
        """Return U V^T (N, d, d) of the last decomposition."""
        return self.U.to_numpy() @ self.V.to_numpy().swapaxes(1, 2)

    @ti.func
    def force_gradient(self, k: ti.template(), f, w):
        """Return the gradient of a weight w by x_p; in MLS-MPM w r/D stands in its place."""
        g = (k - f) * (4.0 / self.start.dx * w)
        if ti.static(not self.is_mls):
            N, dN = splines(f), slopes(f)
            for a in ti.static(range(self.dim)):
                g[a] = dN[k[a]][a] / self.start.dx
                for b in ti.static(range(self.dim)):
                    if ti.static(a != b):
                        g[a] *= N[k[b]][b]
        return g

    @ti.kernel
    def p2g(self):
        """Scatter mass, momentum and internal force."""
        for p in self.x:
            base = ti.floor(self.x[p] / self.start.dx - 0.5).cast(int)
            f = self.x[p] / self.start.dx - base
            N = splines(f)
            self.base[p] = base
            for k in ti.static(ti.grouped(ti.ndrange(*(3,) * self.dim))):
                w = 1.0
                for a in ti.static(range(self.dim)):
                    w *= N[k[a]][a]
                r = (k - f) * self.start.dx
                self.w[p, k] = w
                self.grid_m[base + k] += w * self.m[p]
                self.grid_mv[base + k] += w * self.m[p] * (self.v[p] + self.C[p] @ r)
                self.grid_f[base + k] -= self.V0[p] * self.tau[p] @ self.force_gradient(k, f, w)

    @ti.kernel
    def accelerate(self):
        """Compute the velocities of the nodes with forces and gravity."""
        for i in ti.grouped(self.grid_m):
            if self.grid_m[i] > 0.0:
                momentum = self.grid_mv[i] + self.start.dt * self.grid_f[i]
                self.grid_v_free[i] = momentum / self.grid_m[i] + self.start.dt * self.gravity

    @ti.kernel
    def touch(self):
        """Stop what enters the floor, with Coulomb friction."""
        for i in ti.grouped(self.grid_m):
            u = self.grid_v_free[i]
            approach = u.dot(self.normal)
            if self.solid[i] and approach < 0.0:
                u -= approach * self.normal
                lost = -self.start.friction * approach
                u *= ti.max(0.0, 1.0 - lost / ti.max(u.norm(), lost))
            self.grid_v[i] = u

    @ti.kernel
    def g2p(self):
        """Gather velocity, affine field and velocity gradient, and move the particles."""
        for p in self.x:
            f = self.x[p] / self.start.dx - self.base[p]
            v = ti.Vector.zero(float, self.dim)
            B = ti.Matrix.zero(float, self.dim, self.dim)
            L = ti.Matrix.zero(float, self.dim, self.dim)
            for k in ti.static(ti.grouped(ti.ndrange(*(3,) * self.dim))):
                u, w = self.grid_v[self.base[p] + k], self.w[p, k]
                v += w * u
                B += w * u.outer_product((k - f) * self.start.dx)
                L += u.outer_product(self.force_gradient(k, f, w))
            self.v[p] = v
            self.x[p] += self.start.dt * v
            self.C[p] = 4.0 / self.start.dx**2 * B
            self.L[p] = L

    @ti.kernel
    def deform(self):
        """Compute F_trial = (I + dt L) F, or J <- det(I + dt L) J of a fluid, which has no F."""
        for p in self.x:
            growth = ti.Matrix.identity(float, self.dim) + self.start.dt * self.L[p]
            if ti.static(self.is_fluid):
                self.J[p] *= growth.determinant()
            else:
                self.F_trial[p] = growth @ self.F[p]
                self.F[p] = self.F_trial[p]

    @ti.kernel
    def library_svd(self):
        """Decompose F = U diag(s) V^T by the library."""
        for p in self.x:
            U, S, V = ti.svd(self.F[p])
            self.U[p], self.V[p] = U, V
            for a in ti.static(range(self.dim)):
                self.s[p][a] = S[a, a]

    @ti.kernel
    def jelly_stress(self):
        """Compute tau = 2 mu (F - R) F^T + lam (J - 1) J I with R = U V^T, and its energy."""
        for p in self.x:
            F, J = self.F[p], self.F[p].determinant()
            strain = F - self.U[p] @ self.V[p].transpose()
            volume = self.start.lam * (J - 1.0) * J * ti.Matrix.identity(float, self.dim)
            self.tau[p] = 2.0 * self.start.mu * strain @ F.transpose() + volume
            self.psi[p] = (self.start.mu * strain.norm_sqr()
                           + 0.5 * self.start.lam * (J - 1.0) ** 2)

    @ti.kernel
    def fluid_stress(self):
        """Compute tau = lam (J - 1) J I and its energy."""
        for p in self.x:
            J = self.J[p]
            self.tau[p] = (self.start.lam * (J - 1.0) * J) * ti.Matrix.identity(float, self.dim)
            self.psi[p] = 0.5 * self.start.lam * (J - 1.0) ** 2

    @ti.func
    def diagonal(self, s):
        """Return the matrix diag(s) of a vector."""
        A = ti.Matrix.zero(float, self.dim, self.dim)
        for a in ti.static(range(self.dim)):
            A[a, a] = s[a]
        return A

    @ti.kernel
    def sand_return(self):
        """Bring F back to the cone of Drucker and Prager."""
        mu, lam = self.start.mu, self.start.lam
        for p in self.x:
            e = ti.log(self.s[p])
            e_hat = e - e.sum() / self.dim
            steepness = self.start.alpha * (self.dim * lam + 2.0 * mu) / (2.0 * mu)
            excess = e_hat.norm() + steepness * e.sum()
            if e.sum() > 0.0:
                self.s[p].fill(1.0)
            elif excess > 0.0:
                self.s[p] = ti.exp(e - excess / e_hat.norm() * e_hat)
            self.F[p] = self.U[p] @ self.diagonal(self.s[p]) @ self.V[p].transpose()

    @ti.kernel
    def sand_stress(self):
        """Compute tau = U diag(2 mu e + lam tr e) U^T with e = log s, and its energy."""
        for p in self.x:
            e = ti.log(self.s[p])
            principal = 2.0 * self.start.mu * e + self.start.lam * e.sum()
            self.tau[p] = self.U[p] @ self.diagonal(principal) @ self.U[p].transpose()
            self.psi[p] = self.start.mu * e.norm_sqr() + 0.5 * self.start.lam * e.sum() ** 2

    @ti.kernel
    def add_energies(self):
        """Add up the kinetic, elastic and gravitational energy."""
        for p in self.x:
            spin = self.start.dx**2 / 4.0 * self.C[p].norm_sqr()
            self.energy[0] += 0.5 * self.m[p] * (self.v[p].norm_sqr() + spin)
            self.energy[1] += self.V0[p] * self.psi[p]
            self.energy[2] -= self.m[p] * self.gravity.dot(self.x[p])
