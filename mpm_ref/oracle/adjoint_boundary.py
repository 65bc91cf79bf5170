"""How nodal velocities after the boundary conditions change with those before, in any floating
type: along one direction after the other, in the branch that `plain.boundary` takes.
"""

import numpy as np

from ..plain import boundary
from .scales import LARGEST, STEP, size


def matrix(v, contacts):
    """du/dv (d, d) of u = `plain.boundary.meet`(v, contacts)."""
    for kinds in (("prescribed",), ("prescribed", "sticky")):
        if boundary.of_kind(contacts, v, *kinds):
            return np.zeros((len(v), len(v)), v.dtype)
    planes = boundary.nearest(v, contacts)
    if planes is None:
        return np.zeros((len(v), len(v)), v.dtype)
    return np.stack([rubbed(v, planes, e) for e in np.eye(len(v), dtype=v.dtype)], axis=1)


def rubbed(v, planes, e):
    """The change of `plain.boundary.rub`(v, planes) as v moves along e (d,)."""
    still = [c._replace(v=0 * v) for c in planes]
    u, du = v + boundary.change(v, planes), e + boundary.change(e, still)
    loads = boundary.loads(v, planes)
    grips = [c.mu * abs(l) for c, l in zip(planes, loads)]
    dgrips = [c.mu * np.sign(l) * dl for c, l, dl in zip(planes, loads, boundary.loads(e, still))]
    grip = sum(grips)
    if not grip > 0:
        return du
    drift = sum(g * c.v for g, c in zip(grips, planes)) / grip
    turning = sum(dg * (c.v - drift) for dg, c in zip(dgrips, planes)) / grip
    t, dt = ((a + boundary.change(a, still)) for a in (u - drift, du - turning))
    speed = boundary.length(t)
    if grip >= speed:
        return du - dt
    slower = sum(dgrips) / speed - grip * (t @ dt) / speed**3
    return du - grip / speed * dt - slower * t


def before(v, S_v, contacts, bar):
    """Bars of velocities before the conditions, and their scales, over the box.

    v (.., d) are the velocities before them with the scales S_v; bar is that of those after, a pair
    of values and scales. How a bar changes with v is found by differences.
    """
    value, S = bar[0].copy(), bar[1].copy()
    for i, at_node in contacts.items():
        A = matrix(v[i], at_node)
        value[i] = A.T @ bar[0][i]
        change = sum(size(bar[0][i] @ (B - A), 0) for B in moved(v[i], S_v[i], at_node))
        rounding = 2 * (1 + sum(c.mu for c in at_node)) * size(bar[0][i], 0)    # see `scales.held`
        S[i] = size(A, 0) * S[i] + rounding + change
    return value, S


def moved(v, S_v, contacts):
    """`matrix` where v is off by its scale, as the slope there predicts it: from both sides, along
    each axis.
    """
    speed, here = size(v, 0), matrix(v, contacts)
    h = min(STEP * S_v, LARGEST * speed) if speed > 0 else STEP * S_v
    if h > 0:
        for e in np.eye(len(v), dtype=v.dtype):
            for step in (h, -h):
                yield here + (matrix(v + step * e, contacts) - here) * (S_v / h)
