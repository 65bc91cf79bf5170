"""How nodal velocities after the boundary conditions change with those before, in any floating
type: along one direction after the other, in the branch that `plain.boundary` takes.
"""

import numpy as np

from ..plain import boundary


def matrix(v, contacts):
    """du/dv (d, d) of u = `plain.boundary.contact_velocity`(v, contacts)."""
    for kinds in (("prescribed",), ("prescribed", "sticky")):
        if boundary.contacts_of_kind(contacts, v, *kinds):
            return np.zeros((len(v), len(v)), v.dtype)
    planes = boundary.active_planes(v, contacts)
    if planes is None:
        return np.zeros((len(v), len(v)), v.dtype)
    return np.stack([rubbed(v, planes, e) for e in np.eye(len(v), dtype=v.dtype)], axis=1)


def rubbed(v, planes, e):
    """The change of `plain.boundary.apply_friction`(v, planes) as v moves along e (d,)."""
    still = [c._replace(v=0 * v) for c in planes]
    u, du = v + boundary.correction(v, planes), e + boundary.correction(e, still)
    loads = boundary.multipliers(v, planes)
    grips = [c.mu * abs(l) for c, l in zip(planes, loads)]
    changes = boundary.multipliers(e, still)
    dgrips = [c.mu * np.sign(l) * dl for c, l, dl in zip(planes, loads, changes)]
    grip = sum(grips)
    if not grip > 0:
        return du
    drift = sum(g * c.v for g, c in zip(grips, planes)) / grip
    turning = sum(dg * (c.v - drift) for dg, c in zip(dgrips, planes)) / grip
    t, dt = ((a + boundary.correction(a, still)) for a in (u - drift, du - turning))
    speed = boundary.length(t)
    if grip >= speed:
        return du - dt
    slower = sum(dgrips) / speed - grip * (t @ dt) / speed**3
    return du - grip / speed * dt - slower * t


def before_conditions(v, contacts, bar):
    """Return the bars of velocities before the conditions, over the box.

    v (.., d) are the velocities before them, `bar` is that of the velocities after.
    """
    out = bar.copy()
    for i, at_node in contacts.items():
        out[i] = matrix(v[i], at_node).T @ bar[i]
    return out
