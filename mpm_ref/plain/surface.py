"""Contact at the surface of a collider, between the nodes: the rows of its equations.

The velocity of the matter at a point of a surface is interpolated along the normal between a node
behind the surface and a plane of nodes in front of it; docs/explanation/boundaries.md explains the
rule. `surface_row` returns the nodes and weights of one such point, `held_velocities` the nodal
velocities nearest to given ones, in the metric of the masses, that meet all equations at once.
"""

from itertools import product

import numpy as np

NEAR = 0.75         # cells in front of a surface, up to which nodes carry its condition
LIGHT = 1e-2        # of the heaviest node of a plane: a node below it does not count
DEEP = 2.0          # cells behind a surface, out of reach of matter in front of it


def surface_row(node, distance, n, m):
    """Return {node: weight} of the point of a surface that belongs to a node.

    node: indices (d,); distance: of the node from the surface [cells], negative behind it; n:
    outward normal (d,); m: masses [kg] by node, of a grid (n1, .., nd). Nodes are tuples.
    """
    axis = int(np.argmax(np.abs(n)))
    foot = np.asarray(node) - distance * n
    start = round(float(foot[axis] + NEAR * n[axis]), 9)
    plane = np.ceil(start) if n[axis] > 0 else np.floor(start)
    D = (plane - foot[axis]) / n[axis]
    corners = plane_corners(foot + D * n, axis, int(plane), m)
    total = sum(corners.values())
    if total == 0 or distance < -DEEP:
        return {tuple(node): 1.0}
    row = {tuple(node): D / (D - distance)}
    for corner, w in corners.items():
        row[corner] = row.get(corner, 0.0) - distance / (D - distance) * w / total
    return row


def plane_corners(r, axis, plane, m):
    """Return {node: weight} of linear interpolation to r in a plane of nodes, where there is mass.

    r: point (d,) [cells]; axis: normal to the plane, which has the index `plane` on it.
    """
    low = np.floor(r + 1e-9).astype(int)
    part = np.maximum(r - low, 0.0)
    corners = {}
    for offset in product(*(((0,) if a == axis else (0, 1)) for a in range(len(r)))):
        corner = low + offset
        corner[axis] = plane
        w = np.prod([p if o else 1.0 - p for a, (p, o) in enumerate(zip(part, offset, strict=True))
                     if a != axis])
        inside = (corner >= 0).all() and (corner < m.shape).all()
        if inside and w > 0.0 and m[tuple(corner)] > 0.0:
            corners[tuple(corner)] = float(w)
    heaviest = max((m[corner] for corner in corners), default=0.0)
    return {corner: w for corner, w in corners.items() if m[corner] >= LIGHT * heaviest}


def held_velocities(v, m, rows, targets):
    """Return nodal velocities (n1, .., nd, d) that meet sum_i a_i v_i = target for all rows, and
    the impulses (K, d) [kg m/s].

    rows: K dictionaries {node: a}; targets (K, d) [m/s]. The change is the smallest in the metric
    of the masses, m_i dv_i = sum_k a_ki l_k with (A M^-1 A^T) l = targets - A v.
    """
    nodes = sorted({node for row in rows for node in row})
    A = np.array([[row.get(node, 0.0) for node in nodes] for row in rows])
    inverse = np.array([1.0 / m[node] for node in nodes])
    gap = np.asarray(targets) - A @ np.array([v[node] for node in nodes])
    impulses = np.linalg.lstsq(A * inverse @ A.T, gap, rcond=None)[0]
    out = v.copy()
    for node, dv in zip(nodes, inverse[:, None] * (A.T @ impulses), strict=True):
        out[node] = v[node] + dv
    return out, impulses
