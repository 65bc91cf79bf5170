"""A step of deformation and its adjoint over the tables of laws and flows: what tests measure.

The loss is the inner product of all that a step leaves with random weights, which are the bars that
the adjoint is given. `measured` is meant for a process without compilation, where the whole table
takes seconds: the text is the same.
"""

import zlib
from typing import NamedTuple

import numpy as np
from constitutive import LAW, rate, rotations, transpose
from flows import CASES, setting

from mpm_ref.core import deform
from mpm_ref.core.adjoint import corotated, strain
from mpm_ref.core.adjoint import deform as adjoint
from mpm_ref.core.adjoint.deform import DeformBars, DeformStep
from mpm_ref.core.jit import CHUNKS
from mpm_ref.core.law import project_vjp
from mpm_ref.core.state import NO_HISTORY, NONE, Particles
from mpm_ref.materials import FixedCorotated, Fluid, NoFlow, SnowClamp

DT = 0.3                                # so long that L counts as much as F
STEPS = np.geomspace(3e-4, 1e-5, 4)     # of Taylor tests
ROUND_OFF = 1e-13
GAPS = (0.0, 1e-4, 1e-15, 1e-12, 1e-10, 1e-8, 1e-6)
LIFTED = {"drucker_prager", "von_mises"}            # tested with s_min > 0, the others without

# Principal stretches of F_trial; in 2D the first and the last.
STRETCHES = {
    "rest": (1.0, 1.0, 1.0), "compressed": (0.97, 0.97, 0.97), "expanded": (1.1, 1.1, 1.1),
    "two": (1.3, 1.3, 0.7), "two smaller": (1.1, 0.7, 0.7),
    "nearly": (1.2, 1.2 - 1e-9, 1.2 - 2e-9), "two nearly": (1.2, 1.2 - 1e-9, 0.7),
    "flat": (1.2, 0.95, 0.08), "singular": (1.2, 0.95, 1e-3), "mild": None, "random": None,
}
INVERTED = {"inverted": (1.2, 0.95, -0.3)}
SPREAD = {"mild": 0.01, "random": 0.3}
MEAN = 0.97
NOT_HERE = {
    ("drucker_prager", "rest"): "the tip of the cone is a kink",
    ("herschel_bulkley", "singular"): "the return itself loses digits in the least stretch",
}


class State(NamedTuple):
    """What a step reads of N particles, and the weights of what it leaves."""

    F: np.ndarray       # (N, d, d) or (N,)
    L: np.ndarray       # (N, d, d)
    y: np.ndarray       # (N,) or (0, 0)
    weights: tuple      # of F, tau, y after the step


def materials(d):
    """{name: (law, flow, whether J alone is carried)} of everything the tables allow."""
    found = {name: (*setting(name, d, **({"s_min": 0.05} if name in LIFTED else {})), False)
             for name in CASES if name != "none"}
    for name, law in LAW.items():
        found[f"none on {name}"] = law, NoFlow(), False
        if not isinstance(law, Fluid):
            found[f"snow_clamp on {name}"] = law, SnowClamp(0.9, 1.05), False
    return found | {"fluid of J": (LAW["fluid"], NoFlow(), True)}


def families(name, law):
    """Stretches of the states that a material is tested in, by their names."""
    inverted = INVERTED if isinstance(law, Fluid | FixedCorotated) else {}
    return {key: s for key, s in (STRETCHES | inverted).items() if (name, key) not in NOT_HERE}


def states(rng, s, material, L_size=0.2):
    """`State` of N particles whose F_trial has the principal stretches s (N, d)."""
    _, flow, J_only = material
    n, d = s.shape
    L = L_size * rng.standard_normal((n, d, d))
    F = rotations(rng, n, d) * s[:, None] @ rotations(rng, n, d)
    F = np.linalg.solve(np.eye(d) + DT * L, F)
    if J_only:
        F = np.linalg.det(F)
    remembers = hasattr(flow, "xi") or hasattr(flow, "theta")
    y = rng.choice([0.02, 0.3, 0.5], n) if remembers else NO_HISTORY
    return State(F, L, y, tuple(rng.standard_normal(a.shape) for a in (F, F, y)))


def family(key, s, material, d, n=8):
    """`State` of n particles of one family, the same in every process."""
    rng = np.random.default_rng(zlib.crc32(key.encode()))
    if s is None:
        s = MEAN * np.exp(SPREAD[key] * rng.standard_normal((n, d)))
    else:
        s = np.tile(s if d == 3 else (s[0], s[2]), (n, 1))
    return states(rng, s, material)


def matter(q):
    """`Particles` with copies of the state, for the loops of `deform`."""
    n, d, _ = q.L.shape
    x, F, y = np.zeros((n, d)), q.F.copy(), q.y.copy()
    return Particles(x, NONE, NONE, q.L, F, np.empty_like(F), NONE, NONE, y, NONE)


def loss(q, law, flow):
    """The terms of the loss: all that `deform` leaves, times the weights."""
    p, bounds, like = matter(q), (0, len(q.L)), tuple(range(q.L.shape[1]))
    if p.F.ndim == 1:
        deform.deform_fluid(p, law, DT, like, bounds)
    elif isinstance(flow, NoFlow):
        deform.deform_elastic(p, law, DT, like, bounds)
    elif deform.is_radial(law, flow):
        deform.deform_radial(p, law, flow, DT, like, bounds)
    else:
        deform.deform_plastic(p, law, flow, DT, like, bounds)
    return np.concatenate([(a * w).ravel() for a, w in zip((p.F, p.tau, p.y), q.weights)])


def gradients(q, law, flow):
    """{"F", "L", "y" and each parameter: gradient of `loss`}, by the serial loops."""
    bars, step, like = seeds(q, law, flow)
    for c in range(CHUNKS):
        if q.F.ndim == 1:
            adjoint.fluid_vjp(step, bars, law, like, c)
        elif isinstance(flow, NoFlow):
            serial_elastic(law, len(like))(step, bars, law, like, c)
        else:
            adjoint.plastic_vjp(step, bars, law, flow, like, c)
    return named(bars, step.sums, law, flow)


def serial_elastic(law, d):
    """The loop over a chunk that differentiates a law without a flow."""
    if corotated.fits(law, d):
        return corotated.elastic_blocks
    return strain.elastic_strain_blocks if strain.fits(law, d) else adjoint.elastic_vjp


def loss_at_start(q, law, flow):
    """The terms of F and of the stress of the state as it stands."""
    p, bounds = matter(q), (0, len(q.L))
    if p.F.ndim == 1:
        deform.stress_fluid(p, law, bounds)
    else:
        deform.stress(p, law, flow, tuple(range(q.L.shape[1])), bounds)
    return np.concatenate([(a * w).ravel() for a, w in zip((p.F, p.tau), q.weights)])


def gradients_at_start(q, law, flow):
    """{"F" and each parameter: gradient of `loss_at_start`}."""
    bars, step, like = seeds(q, law, flow)
    for c in range(CHUNKS):
        if q.F.ndim == 1:
            adjoint.initial_pressure_vjp(q.F, bars, law, step.sums, c)
        else:
            adjoint.initial_stress_vjp(step, bars, law, flow, like, c)
    found = named(bars, step.sums, law, flow)
    return {name: g for name, g in found.items() if name not in ("L", "y")}


def at_start(q):
    """F_trial as a state; the first particle has failed, where it can."""
    grown = np.eye(q.L.shape[1]) + DT * q.L
    F = grown @ q.F if q.F.ndim == 3 else np.linalg.det(grown) * q.F
    return q._replace(F=F, y=q.y * (np.arange(len(q.y)) > 0))


def seeds(q, law, flow):
    """Bars before an adjoint pass, the step it goes through, and a tuple of length d."""
    w_F, w_tau, w_y = q.weights
    bars = DeformBars(w_F.copy(), w_tau, np.full_like(q.L, np.nan), w_y.copy(), NONE)
    sums = np.zeros((CHUNKS, len(law) + len(flow)))
    return bars, DeformStep(q.F, q.y, q.L, sums, DT), tuple(range(q.L.shape[1]))


def named(bars, sums, law, flow):
    """Bars by name."""
    parameters = dict(zip((*law._fields, *flow._fields), sums.sum(axis=0)))
    return {"F": bars.F, "L": bars.L, "y": bars.y, **parameters}


def moved(q, law, flow, name, step):
    """State, law and flow with one argument changed."""
    if name in q._fields:
        return q._replace(**{name: getattr(q, name) + step}), law, flow
    if name in law._fields:
        return q, law._replace(**{name: getattr(law, name) + step}), flow
    return q, law, flow._replace(**{name: getattr(flow, name) + step})


def taylor(q, law, flow, loss=loss, gradients=gradients):
    """{argument: fitted order of the remainder, or None where it is round-off at every step}."""
    rng, found = np.random.default_rng(1), {}
    at, gradient = loss(q, law, flow), gradients(q, law, flow)
    floor = ROUND_OFF * np.abs(at).sum()
    for name, g in gradient.items():
        direction = rng.standard_normal(np.shape(g))
        if name == "F" and q.F.ndim == 3:       # relative to the smallest stretch
            direction *= np.linalg.svd(q.F)[1][:, -1:, None]
        error = np.array([abs((loss(*moved(q, law, flow, name, h * direction)) - at).sum()
                              - h * (g * direction).sum()) for h in STEPS])
        seen = error > floor
        found[name] = rate(STEPS[seen], error[seen]) if seen.sum() > 1 else None
    return found


def turned(q, law, flow):
    """Largest change of the gradients when axes are turned in space and at rest, but for the turn:
    F -> Q F R^T, L -> Q L Q^T, and the bars of F, tau and L as they.
    """
    rng, (n, d, _) = np.random.default_rng(2), q.L.shape
    Q, R = rotations(rng, n, d), rotations(rng, n, d)
    if q.F.ndim == 1:
        other = q._replace(L=Q @ q.L @ transpose(Q))
    else:
        w_F, w_tau, w_y = q.weights
        weights = Q @ w_F @ transpose(R), Q @ w_tau @ transpose(Q), w_y
        other = State(Q @ q.F @ transpose(R), Q @ q.L @ transpose(Q), q.y, weights)
    here, there = gradients(q, law, flow), gradients(other, law, flow)
    here["L"] = Q @ here["L"] @ transpose(Q)
    if q.F.ndim == 3:
        here["F"] = Q @ here["F"] @ transpose(R)
    return max(apart(here, there).values())


def apart(one, other):
    """{argument: largest difference of two gradients, over the size of the larger one}."""
    return {name: np.abs(a - other[name]).max(initial=0.0)
            / max(np.abs(a).max(initial=0.0), np.abs(other[name]).max(initial=0.0), 1.0)
            for name, a in one.items()}


def across_gaps(material, d):
    """Change of the gradients as two singular values part by each of GAPS."""
    law, flow, _ = material
    found = []
    for gap in GAPS:
        s = np.tile((1.1, 1.1, 0.7) if d == 3 else (0.7, 0.7), (8, 1))
        s[:, 0] += gap
        found.append(gradients(states(np.random.default_rng(3), s, material), law, flow))
    return [max(apart(found[0], other).values()) for other in found]


def share(s, y, law, flow):
    """What the return map leaves of the deviator at singular values s."""
    return project_vjp((tuple(s), y), ((0.0,) * len(s), 0.0), DT, law, flow)[2]


def branches(q, law, flow):
    """Branches of the return map that the states take: what is left of the deviator."""
    if q.F.ndim == 1:
        return set()
    all_s = np.linalg.svd(q.F + DT * q.L @ q.F)[1]
    shares = [share(s, q.y[p] if q.y.ndim == 1 else 0.0, law, flow) for p, s in enumerate(all_s)]
    return {"all" if x == 1.0 else "part" if x else "none" for x in shares}


def at_yield(material, d):
    """Orders of the remainder along a path that leaves the yield surface: from a state just within
    it inwards, from one just beyond it outwards, and across it.
    """
    law, flow, _ = material
    shape = np.array((0.6, 0.1, -0.7) if d == 3 else (0.6, -0.6))
    low, high = 0.0, 1.0
    while high - low > 1e-9:
        a = 0.5 * (low + high)
        low, high = (low, a) if share(0.95 * np.exp(a * shape), 0.3, law, flow) < 1 else (a, high)
    found = {}
    for way, a, sign in (("inwards", low, -1), ("outwards", high, 1), ("across", low, 1)):
        s = np.tile(0.95 * np.exp(a * shape), (4, 1))
        q, dq = (states(np.random.default_rng(5), x, material, L_size=0.0) for x in (s, s * shape))
        q = q._replace(y=np.full(4, 0.3) if q.y.ndim == 1 else q.y)
        at, slope = loss(q, law, flow), sign * (gradients(q, law, flow)["F"] * dq.F).sum()
        error = [abs((loss(q._replace(F=q.F + sign * h * dq.F), law, flow) - at).sum() - h * slope)
                 for h in STEPS]
        found[way] = rate(STEPS, error)
    return found


def measured(d):
    """{material: what the tests judge}, and the gradients of some for the compiled code."""
    found = {}
    for name, material in materials(d).items():
        law, flow, _ = material
        all_q = {key: family(key, s, material, d) for key, s in families(name, law).items()}
        found[name] = {
            "orders": {key: taylor(q, law, flow) for key, q in all_q.items()},
            "orders at start": {
                key: taylor(at_start(q), law, flow, loss_at_start, gradients_at_start)
                for key, q in all_q.items()},
            "branches": sorted(set().union(*(branches(q, law, flow) for q in all_q.values()))),
            "turned": max(turned(q, law, flow) for q in all_q.values()),
            "gaps": across_gaps(material, d),
            "at yield": at_yield(material, d) if hasattr(flow, "tau_y") or hasattr(flow, "alpha")
            else None,
        }
    return found
