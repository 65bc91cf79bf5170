"""The twin of the adjoint by itself: its bars of laws, return maps, walls and weights are the
derivatives of the plain twin's own functions.
"""

import numpy as np
import pytest

from mpm_ref.materials import (
    DruckerPrager,
    FixedCorotated,
    FixedCorotatedVonMises,
    Fluid,
    FluidProjection,
    Hardening,
    Hencky,
    HerschelBulkley,
    LogNeoHookean,
    NeoHookean,
    NoFlow,
    SnowClamp,
    Softening,
    VonMises,
)
from mpm_ref.oracle import plain_adjoint, plain_adjoint_laws
from mpm_ref.oracle.plain_adjoint_transfer import curved_pairs
from mpm_ref.plain import boundary
from mpm_ref.plain.boundary import Contact
from mpm_ref.plain.flows import return_map
from mpm_ref.plain.laws import kirchhoff
from mpm_ref.plain.spline import pairs
from mpm_ref.plain.step import Matter, Method

REAL, DT, STEP = np.longdouble, 1e-3, np.longdouble(1e-6)
JELLY, SAND, PASTE, WATER = (FixedCorotated(4.0, 6.0), Hencky(4.0, 6.0), NeoHookean(4.0, 6.0),
                             Fluid(5.0))
LAWS = (JELLY, SAND, PASTE, LogNeoHookean(4.0, 6.0), WATER)
FLOWS = (
    (SAND, NoFlow(), None), (SAND, VonMises(0.05, 0.05), None),
    (SAND, Hardening(0.05, 0.2, 0.0), 0.05), (SAND, Softening(0.05, 0.3, 0.0), 0.05),
    (SAND, DruckerPrager(0.3, 0.05), None), (PASTE, HerschelBulkley(0.05, 0.02), None),
    (WATER, FluidProjection(), None), (JELLY, SnowClamp(0.98, 1.02), None),
    (JELLY, FixedCorotatedVonMises(0.05), None),
)


def slope(f):
    """df/dh at h = 0, to the fourth order."""
    near, far = (f(k * STEP) - f(-k * STEP) for k in (1, 2))
    return (8 * near - far) / (12 * STEP)


def strained(d, rng, spread=0.04, n=12):
    """Deformation gradients, some with equal singular values, compressed on the whole."""
    F = 0.98 * np.eye(d) + spread * rng.normal(size=(n, d, d))
    F[0] = 0.97 * np.eye(d)
    return F.astype(REAL)


def matter(F, law, flow, y):
    """Particles of which only the material counts."""
    y = None if y is None else np.full(len(F), y, REAL)
    return Matter(None, None, None, F, None, None, None, y, None, law, flow)


def moved(record, by, h):
    """A record of parameters moved along `by`."""
    return type(record)(*(REAL(a) + h * b for a, b in zip(record, by)))


@pytest.mark.parametrize(("law", "flow", "y"), FLOWS, ids=lambda a: type(a).__name__)
def test_bars_of_return_maps_are_their_derivatives(law, flow, y, d, rng):
    F = strained(d, rng)
    q = matter(F, law, flow, y)
    F_bar, dF, y_bar, dy = (rng.normal(size=s).astype(REAL) for s in (*2 * [F.shape],
                                                                     *2 * [len(F)]))
    dlaw, dflow = (rng.normal(size=len(a)).astype(REAL) for a in (law, flow))
    bars = plain_adjoint_laws.return_map_adjoint(q, F, DT, F_bar, None if y is None else y_bar)

    def loss(h):
        at = None if y is None else q.y + h * dy
        new, new_y = return_map(F + h * dF, at, DT, moved(law, dlaw, h), moved(flow, dflow, h))
        return (F_bar * new).sum() + (0 if y is None else (y_bar * new_y).sum())

    ours = (bars.F * dF).sum() + (0 if y is None else (bars.y * dy).sum())
    ours += sum(a.sum() * b for a, b in zip((*bars.law, *bars.flow), (*dlaw, *dflow)))
    assert abs(ours - slope(loss)) <= 1e-10 * abs(ours)
    assert type(flow) is NoFlow or abs(bars.F - F_bar).max() > 1e-3       # something flows


def test_a_yield_surface_between_near_stretches_is_seen(d, rng):
    """There the quotient of two stretches is no mean of slopes: within it nothing flows."""
    F = strained(d, rng, spread=0.002)
    q = matter(F, SAND, VonMises(0.005, 0.0), None)
    F_bar, dF = rng.normal(size=(2, *F.shape)).astype(REAL)
    bars = plain_adjoint_laws.return_map_adjoint(q, F, DT, F_bar, None)
    theirs = slope(lambda h: (F_bar * return_map(F + h * dF, None, DT, *q[-2:])[0]).sum())
    assert abs((bars.F * dF).sum() - theirs) <= 1e-9 * abs(theirs)


@pytest.mark.parametrize("law", LAWS, ids=lambda a: type(a).__name__)
def test_bars_of_stresses_are_their_derivatives(law, d, rng):
    F = strained(d, rng)
    F[1] = np.eye(d)
    tau_bar, dF, dlaw = (rng.normal(size=s).astype(REAL) for s in (F.shape, F.shape, len(law)))
    bars = plain_adjoint_laws.stress_adjoint(F, None, (law, NoFlow()), tau_bar)
    ours = (bars.F * dF).sum() + sum(a.sum() * b for a, b in zip(bars.law, dlaw))
    theirs = slope(lambda h: (tau_bar * kirchhoff(F + h * dF, moved(law, dlaw, h))).sum())
    assert abs(ours - theirs) <= 1e-10 * abs(ours)


def test_bars_of_pressure_are_its_derivatives(rng):
    J, tau_bar, dJ = 1 + 0.1 * rng.normal(size=(3, 9)).astype(REAL)
    bars = plain_adjoint_laws.stress_adjoint(J, None, (WATER, NoFlow()), tau_bar)
    ours = (bars.F * dJ).sum() + 2 * bars.law[0].sum()
    theirs = slope(lambda h: (tau_bar * kirchhoff(J + h * dJ, moved(WATER, (2.0,), h))).sum())
    assert abs(ours - theirs) <= 1e-10 * abs(ours)


def contact(n, v, kind, mu=0.0):
    n = np.array(n, REAL)
    return Contact(n / np.sqrt(n @ n), np.array(v, REAL), kind, REAL(mu))


WALLS = {
    "free": [contact((0, 1, 0), (0, -9, 0), "separate")],
    "slip": [contact((0, 1, 0), (0, 0, 0), "slip")],
    "rubs": [contact((0.1, 1, 0.2), (0.3, 0.2, 0), "separate", 0.1)],
    "sticks to a wall that moves": [contact((0.1, 1, 0.2), (0.3, 0.2, 0), "separate", 9.0)],
    "edge that rubs": [contact((0.1, 1, 0.2), (0.3, 0.2, 0), "slip", 0.1),
                       contact((1, 0.3, 0), (0.1, 0, 0), "slip", 0.05)],
    "corner": [contact((0, 1, 0), (0, 0, 0), "slip"), contact((1, 0.1, 0), (0, 0, 0), "slip"),
               contact((0, 0, 1), (0, 0, 0), "slip")],
    "held": [contact((0, 1, 0), (0.1, 0, 0), "sticky")],
    "approaches": [contact((0, 1, 0), (0.1, 0, 0), "noslip")],
    "prescribed": [contact((0, 1, 0), (0.1, 0, 0), "prescribed")],
}


@pytest.mark.parametrize("case", WALLS)
def test_bars_of_walls_are_their_derivatives(case, rng):
    v, bar, dv = np.array([-0.4, -1.0, 0.7], REAL), *rng.normal(size=(2, 3)).astype(REAL)
    ours = bar @ plain_adjoint.contact_jacobian(v, WALLS[case]) @ dv
    theirs = slope(lambda h: bar @ boundary.contact_velocity(v + h * dv, WALLS[case]))
    assert abs(ours - theirs) <= 1e-12


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_second_derivatives_of_weights(degree, d, rng):
    method = Method(REAL(0.1), degree, "flip")
    x, dx = (rng.uniform(0.2, 0.8, (9, d)).astype(REAL) for _ in range(2))
    ddw = curved_pairs(pairs(x, method.dx, degree), method).ddw
    theirs = slope(lambda h: pairs(x + h * dx, method.dx, degree).dw)
    assert abs(np.einsum("psab,pb->psa", ddw, dx) - theirs).max() < 1e-8 * abs(ddw).max()
