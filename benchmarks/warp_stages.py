"""A step of MPM in Warp, as its users would write it, with an array for every stage.

A step reads the particles before it and writes those after it, so that Warp's tape can go back
through it (`warp_adjoint`).
"""

from functools import cache

import numpy as np
import warp as wp

from . import warp_laws, warp_transfer
from .conformance_cases import double_svd

REALS = {"f32": wp.float32, "f64": wp.float64}
INDICES = (wp.int32, wp.bool)
DECOMPOSE = {2: warp_laws.decompose_2d, 3: warp_laws.decompose_3d}


@cache
def records(dim, precision):
    """Return the structs of particles, nodes and constants for a dimension and a precision."""
    real = REALS[precision]
    vec, mat = wp.types.vector(dim, real), wp.types.matrix((dim, dim), real)

    @wp.struct
    class Particles:
        x: wp.array(dtype=vec)
        v: wp.array(dtype=vec)
        C: wp.array(dtype=mat)
        L: wp.array(dtype=mat)
        F_trial: wp.array(dtype=mat)
        F: wp.array(dtype=mat)
        J: wp.array(dtype=real)         # of a fluid, which has no F
        tau: wp.array(dtype=mat)
        psi: wp.array(dtype=real)
        m: wp.array(dtype=real)
        V0: wp.array(dtype=real)
        w: wp.array(dtype=real, ndim=2)
        U: wp.array(dtype=mat)
        s: wp.array(dtype=vec)
        V: wp.array(dtype=mat)
        energy: wp.array(dtype=real)

    @wp.struct
    class Nodes:
        m: wp.array(dtype=real)
        mv: wp.array(dtype=vec)
        f: wp.array(dtype=vec)
        v_free: wp.array(dtype=vec)
        v: wp.array(dtype=vec)
        solid: wp.array(dtype=wp.bool)

    @wp.struct
    class Constants:
        dx: real
        dt: real
        n: int
        mls: wp.bool
        offset: wp.array(dtype=int, ndim=2)
        gravity: wp.array(dtype=vec)
        normal: vec
        friction: real
        law: wp.array(dtype=real)       # mu, lam
        alpha: real

    add_overloads(dim, Particles, Nodes, Constants)
    return Particles, Nodes, Constants


def add_overloads(dim, Particles, Nodes, Constants):
    """Let Warp compile all kernels for the structs at once, not one by one as they are launched."""
    arguments = {
        warp_transfer.p2g: [Particles, Nodes], warp_transfer.accelerate: [Nodes],
        warp_transfer.touch: [Nodes], warp_transfer.g2p: [Particles, Nodes, Particles],
        warp_laws.deform: [Particles] * 2, warp_laws.expand: [Particles] * 2,
    }
    for kernel, structs in arguments.items():
        wp.overload(kernel, [*structs, Constants])
    of_particles = (warp_laws.polar, warp_laws.jelly_stress, warp_laws.sand_return,
                    warp_laws.sand_stress, warp_laws.fluid_stress, warp_laws.energies,
                    DECOMPOSE[dim])
    for kernel in of_particles:
        wp.overload(kernel, [Particles, Constants])


def allocate(struct, shapes, count=None):
    """Put arrays of zeros into a struct: of the given shapes {name: shape}, else of `count`.

    Those of floats keep their gradients when a tape has passed them.
    """
    for name, field in struct._cls.vars.items():
        if isinstance(field.type, wp.array):
            shape = shapes.get(name, count)
            has_grad = field.type.dtype not in INDICES
            setattr(struct, name, wp.zeros(shape, dtype=field.type.dtype, device="cpu",
                                           requires_grad=has_grad, retain_grad=has_grad))


class WarpStages:
    """Steps from a `Start` on Warp's CPU device, in precision "f32" or "f64".

    svd "library" is Warp's singular value decomposition, "double" that of `double_svd`; "newton"
    is the rotation by Newton's iteration, which is all that a jelly needs.
    """

    def __init__(self, start, precision, svd="library"):
        wp.config.quiet = True
        self.start, self.svd, self.count = start, svd, len(start.x)
        self.is_fluid = start.material == "fluid"
        self.Particles, self.Nodes, self.Constants = records(start.dim, precision)
        self.k, self.q = self.constants(), self.particles()
        for name in ("x", "v", "C", "F"):
            stored = "J" if name == "F" and start.material == "fluid" else name
            getattr(self.q, stored).assign(getattr(start, name))
        self.update_stress(self.q, flows=False)

    def constants(self):
        """Return the constants of the steps."""
        start, k = self.start, self.Constants()
        offsets = np.array(list(np.ndindex((3,) * start.dim)))
        allocate(k, {"offset": offsets.shape, "gravity": 1, "law": 2})
        k.offset.assign(offsets)
        k.gravity.assign(start.gravity[None])
        k.law.assign(np.array([start.mu, start.lam]))
        k.normal = start.normal
        for name in ("dx", "dt", "n", "friction", "alpha"):
            setattr(k, name, getattr(start, name))
        k.mls = start.transfer == "mls"
        return k

    def particles(self):
        """Return the struct of the particles before or after a step."""
        q = self.Particles()
        allocate(q, {"w": (self.count, 3**self.start.dim), "energy": 3}, self.count)
        q.m.assign(self.start.m)
        q.V0.assign(self.start.V0)
        return q

    def nodes(self):
        """Return the struct of the nodes of a step."""
        nodes = self.Nodes()
        allocate(nodes, {}, self.start.n**self.start.dim)
        nodes.solid.assign(self.start.solid.ravel())
        return nodes

    def launch(self, kernel, *structs):
        """Run a kernel over the particles or nodes of its first struct."""
        wp.launch(kernel, structs[0].m.size, [*structs, self.k], device="cpu")

    def advance(self):
        """Advance by a step; return the particles before it, its nodes and the particles after."""
        q, nodes, after = self.q, self.nodes(), self.particles()
        self.launch(warp_transfer.p2g, q, nodes)
        self.launch(warp_transfer.accelerate, nodes)
        self.launch(warp_transfer.touch, nodes)
        self.launch(warp_transfer.g2p, q, nodes, after)
        self.launch(warp_laws.expand if self.is_fluid else warp_laws.deform, q, after)
        self.update_stress(after, flows=True)
        self.q = after
        return q, nodes, after

    def update_stress(self, q, flows):
        """Compute the stress of particles, after the return map of sand where it flows."""
        if not self.is_fluid:
            self.decompose(q)
        if self.start.material == "sand" and flows:
            self.launch(warp_laws.sand_return, q)
        self.launch(getattr(warp_laws, f"{self.start.material}_stress"), q)

    def decompose(self, q):
        """Decompose F of the particles."""
        if self.svd == "double":
            for a, values in zip((q.U, q.s, q.V), double_svd(q.F.numpy()), strict=True):
                a.assign(values)
            return
        self.launch(warp_laws.polar if self.svd == "newton" else DECOMPOSE[self.start.dim], q)

    def step(self):
        """Advance by a step and return its stages, as `oracle.write` takes them."""
        q, nodes, after = self.advance()
        self.launch(warp_laws.energies, after)
        stages = {"mass": nodes.m, "momentum": nodes.mv, "force": nodes.f,
                  "velocity": nodes.v_free, "velocity_bc": nodes.v}
        stages = {name: self.on_grid(a) for name, a in stages.items()}
        stages |= {name: getattr(after, name).numpy() for name in ("x", "v", "C", "L", "tau")}
        if self.is_fluid:
            stages |= {"F": after.J.numpy(), "tau": stages["tau"][:, 0, 0]}
        else:
            stages |= {"F": after.F.numpy(), "F_trial": after.F_trial.numpy()}
        base = np.floor(q.x.numpy() / q.m.numpy().dtype.type(self.k.dx) - 0.5)
        return stages | {"origin": (0,) * self.start.dim, "base": base.astype(int),
                         "weights": q.w.numpy(), "energy": after.energy.numpy()}

    def rotations(self):
        """Return U V^T (N, d, d) of the last decomposition."""
        return self.q.U.numpy() @ self.q.V.numpy().swapaxes(1, 2)

    def on_grid(self, a):
        """Return an array of nodes as one over the axes of the grid."""
        a = a.numpy()
        return a.reshape((self.start.n,) * self.start.dim + a.shape[1:])
