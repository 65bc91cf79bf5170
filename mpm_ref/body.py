"""A body: particles of one material in arrays; and the check that a scheme can step it."""

from typing import NamedTuple

import numpy as np

from .core.law import kirchhoff_hat, returned
from .core.precision import converted
from .core.state import NO_HISTORY, NONE, Particles
from .materials import Fluid, Hardening, NoFlow, Softening

AFFINE = ("apic", "mls")      # transfers that carry C


class Body(NamedTuple):
    """Particles that share a law and a return map. Kernels change the arrays in place."""

    name: str
    particles: Particles
    law: tuple            # NamedTuple of the elastic law's parameters (see materials)
    flow: tuple           # NamedTuple of the return map's parameters
    id: np.ndarray        # (N,) number of each particle in the order in which the body was sampled


def particles_at(x, v, m, V0, transfer="mls", fluid=False):
    """Return particles without stress (F = I) at x (N, d) with velocity v (N, d), mass m (N,),
    volume V0 (N,); all are copied. Only the fields that the transfer needs are allocated; `fluid`
    carries J instead of F. Further fields are set by `_replace`: the history y (N,), a body force b
    (N, d).
    """
    n, d = x.shape
    L = np.zeros((n, d, d))
    C = NONE
    if transfer in AFFINE:
        C = L if transfer == "mls" else np.zeros((n, d, d))
    return Particles(
        *(np.array(a, dtype=float, order="C") for a in (x, v)),
        C=C,
        L=L,
        F=np.ones(n) if fluid else np.tile(np.eye(d), (n, 1, 1)),
        tau=np.zeros(n) if fluid else np.zeros((n, d, d)),
        m=np.array(m, dtype=float),
        V0=np.array(V0, dtype=float),
        y=NO_HISTORY,
        b=NONE,
    )


def in_precision(particles, real):
    """Return particles with arrays of the float type `real`; L stays the array of C where it is.

    Raises ValueError where a mass or a volume becomes zero, or a number infinite.
    """
    with np.errstate(over="ignore"):
        rounded = converted(particles, real)
    for name, a in rounded._asdict().items():
        exact = getattr(particles, name)
        lost = np.isinf(a) & np.isfinite(exact)
        if name in ("m", "V0"):
            lost |= (a == 0.0) & (exact != 0.0)
        if lost.any():
            raise ValueError(f"the number {exact[lost][0]:.3g} in the array {name} is outside of "
                             f"the range of {np.dtype(real)}: expected precision = \"double\"")
    return rounded._replace(L=rounded.C) if particles.L is particles.C else rounded


def with_separate_gradient(particles):
    """Return particles whose velocity gradient L (N, d, d) is another array than C, as an affine
    transfer with relaxation needs: MLS-MPM has one array for both otherwise.
    """
    return particles._replace(L=particles.L.copy())


def permute(body, order):
    """Put the particles of a body into the given order, in place."""
    for name, a in zip(Particles._fields, body.particles, strict=True):
        carried = len(a) == len(order)
        if carried and not (name == "L" and a is body.particles.C):
            a[:] = a[order]
    body.id[:] = body.id[order]


def change_rows(body, change):
    """Return a body with change(a) in place of each array a with an entry for each particle; C and
    L stay one array where they are.
    """
    q = body.particles
    new = Particles(*(change(a) if len(a) == len(body.id) else a for a in q))
    if q.L is q.C:
        new = new._replace(L=new.C)
    return body._replace(particles=new, id=change(body.id))


def select_rows(body, which):
    """Return a body with the particles of a mask (N,) alone, in their order; arrays are copied."""
    return change_rows(body, lambda a: a[which])


def append(body, more):
    """Return a body with the particles of another one of the same kind behind its own."""
    both = zip(body.particles, more.particles, strict=True)
    joined = Particles(*(np.concatenate(pair) for pair in both))
    if body.particles.L is body.particles.C:
        joined = joined._replace(L=joined.C)
    return body._replace(particles=joined, id=np.concatenate([body.id, more.id]))


def filled(bodies):
    """Return the bodies that have particles."""
    return tuple(body for body in bodies if len(body.id))


def restore_order(values, number, size=None):
    """Return rows (N, ..) in the order in which their body was sampled.

    A run sorts particles now and then; number (N,) is the body's `id`, the first place of each.
    With a size > N, of a body whose particles enter and leave, rows without particle are NaN.
    """
    if size in (None, len(values)):
        ordered = np.empty_like(values)
    else:
        ordered = np.full((size, *values.shape[1:]), np.nan, values.dtype)
    ordered[number] = values
    return ordered


def keep_inside(bodies, low, high):
    """Clip positions to a box, velocities unchanged (NCLaw)."""
    for body in bodies:
        np.clip(body.particles.x, low, high, out=body.particles.x)


def check_fit(body, scheme, dim):
    """Raise ValueError, in one sentence, if a body of d = dim cannot be stepped by a scheme."""
    for wrong in (*_wrong_material(body, dim), *_wrong_arrays(body, dim),
                  *_wrong_fields(body, scheme), *_wrong_numbers(body)):
        raise ValueError(f"body {body.name!r}: {wrong}")


def _wrong_material(body, d):
    for part in (body.law, body.flow):
        if getattr(part, "dim", d) != d:
            yield f"its {type(part).__name__} is for {part.dim} dimensions, expected {d}"
    whole = isinstance(body.flow, NoFlow) or type(body.flow) in returned.methods
    if not whole and type(body.law) not in kirchhoff_hat.methods:
        law, flow = type(body.law).__name__, type(body.flow).__name__
        yield (f"the flow {flow} acts on singular values, the law {law} is no function of them; "
               "expected NoFlow, or a flow of F as a whole")


def _wrong_arrays(body, d):
    q, n = body.particles, len(body.particles.x)
    if n == 0:
        yield "it has no particles; expected at least one"
    shapes = {"x": (n, d), "v": (n, d), "L": (n, d, d), "m": (n,), "V0": (n,)}
    for name, shape in shapes.items():
        if getattr(q, name).shape != shape:
            yield f"{name} has shape {getattr(q, name).shape}, expected {shape}"
    if body.id.shape != (n,):
        yield f"id has shape {body.id.shape}, expected {(n,)}"


def _wrong_fields(body, scheme):
    q, n, transfer = body.particles, len(body.particles.x), scheme.transfer
    others = {name: a.dtype for name, a in q._asdict().items() if a.dtype != scheme.real}
    for name, kind in others.items():
        yield (f"{name} is of type {kind}, expected {np.dtype(scheme.real)} with precision = "
               f"{scheme.precision!r}; see in_precision")
    if (q.C.ndim == 3) != (transfer in AFFINE):
        has, needs = ("a", "none") if q.C.ndim == 3 else ("no", "one")
        yield f"it carries {has} C, the transfer {transfer!r} needs {needs}; see particles_at"
    elif (q.L is q.C) != scheme.one_gradient:
        yield ("L must be the same array as C for 'mls' without relaxation, and only then; the "
               f"transfer is {transfer!r}, relaxation {scheme.relaxation}")
    fluid = isinstance(body.law, Fluid) and isinstance(body.flow, NoFlow)
    if q.F.shape not in (q.L.shape, (n,)) or (q.F.ndim == 1) > fluid:
        yield f"F has shape {q.F.shape}, expected {q.L.shape}, or ({n},) for a fluid without flow"
    if q.tau.shape != q.F.shape:
        yield f"tau has shape {q.tau.shape}, expected that of F, {q.F.shape}"
    if isinstance(body.flow, Hardening | Softening) and q.y.shape != (n,):
        flow = type(body.flow).__name__
        yield f"the flow {flow} changes y, which has shape {q.y.shape}, expected ({n},)"


def _wrong_numbers(body):
    q = body.particles
    for name in ("x", "v", "F", "m", "V0", "C", "y", "b"):
        a = getattr(q, name)
        if not np.isfinite(a).all():
            p = int(np.argwhere(~np.isfinite(a))[0][0])
            yield f"{name} of particle {body.id[p]} is {a[p]}, expected finite numbers"
    for name in ("m", "V0"):
        a = getattr(q, name)
        if not (a > 0.0).all():
            p = int(np.argmin(a > 0.0))
            yield f"{name} of particle {body.id[p]} is {a[p]}, expected a positive number"
