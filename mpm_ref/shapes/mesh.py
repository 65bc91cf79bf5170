"""Compute the inside of a closed triangle mesh by its winding number along vertical lines.

The line through a point along the last axis crosses triangles; each crossing above the point counts
+1 or -1 by the triangle's orientation. The sum is the winding number: 1 inside a mesh whose normals
point outward, 0 outside. Triangles are binned by their projection onto the other two axes, so that
few of them are tested for a point.
"""

from math import floor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange

# The line is offset from the point by these shares of the mesh's size, so that it misses edges and
# vertices: points and vertices often share a coordinate.
OFFSET = (1.1e-9, 1.7e-9)
PER_BIN = 2             # triangles per bin, on average
MAX_SIDE = 1024         # bins along an axis


class Bins(NamedTuple):
    """Triangles grouped by the squares of a plane lattice that their projections meet."""

    a: np.ndarray           # (M, 3)  first corners [m]
    b: np.ndarray           # (M, 3)  second corners
    c: np.ndarray           # (M, 3)  third corners
    low: np.ndarray         # (2,)    corner of the lattice
    width: np.ndarray       # (2,)    of a square
    start: np.ndarray       # (n, n + 1)  first entry of a square in `member`
    member: np.ndarray      # triangle indices


def bins_of(triangles):
    """Return the `Bins` of triangles (M, 3, 3): index, corner, coordinate."""
    corners = [np.ascontiguousarray(triangles[:, k], dtype=float) for k in range(3)]
    low, high = triangles.min(axis=(0, 1))[:2], triangles.max(axis=(0, 1))[:2]
    n = int(np.clip(np.sqrt(len(triangles) / PER_BIN), 1, MAX_SIDE))
    width = np.maximum(high - low, np.finfo(float).tiny) / n * (1.0 + 1e-6)
    first = _squares(triangles.min(axis=1)[:, :2], low, width, n)
    last = _squares(triangles.max(axis=1)[:, :2], low, width, n)
    start = np.zeros((n, n + 1), dtype=np.int64)
    _count(first, last, start)
    ends = np.cumsum(start[:, 1:].ravel()).reshape(n, n)
    start[:, 1:] = ends
    start[1:, 0] = ends[:-1, -1]
    member = np.empty(int(ends[-1, -1]), dtype=np.int64)
    _enter(first, last, start[:, :-1].copy(), member)
    return Bins(*corners, low, width, start, member)


def _squares(x, low, width, n):
    """Return the squares (M, 2) of points."""
    return np.clip(np.floor((x - low) / width), 0, n - 1).astype(np.int64)


@kernel
def _count(first, last, start):
    for t in range(len(first)):
        for i in range(first[t, 0], last[t, 0] + 1):
            for j in range(first[t, 1], last[t, 1] + 1):
                start[i, j + 1] += 1


@kernel
def _enter(first, last, free, member):
    for t in range(len(first)):
        for i in range(first[t, 0], last[t, 0] + 1):
            for j in range(first[t, 1], last[t, 1] + 1):
                member[free[i, j]] = t
                free[i, j] += 1


@kernel
def _side(a, b, p):
    """Return twice the signed area of the plane triangle a, b, p.

    Odd under a <-> b to the last bit: a line on an edge crosses one of its two triangles.
    """
    if (a[0], a[1]) < (b[0], b[1]):
        return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    else:
        return (b[0] - a[0]) * (p[1] - b[1]) - (b[1] - a[1]) * (p[0] - b[0])


@kernel
def _crossing(a, b, c, p):
    """Return +1 or -1, by orientation, if the triangle lies above the point p, else 0."""
    u, v, w = _side(b, c, p), _side(c, a, p), _side(a, b, p)
    if u > 0.0 and v > 0.0 and w > 0.0:
        sign = 1
    elif u < 0.0 and v < 0.0 and w < 0.0:
        sign = -1
    else:
        return 0
    above = (u * a[2] + v * b[2] + w * c[2]) / (u + v + w) > p[2]
    return sign if above else 0


@kernel
def _wind(x, offset, bins, number, bounds):
    """Set number[p] to the winding number of the mesh around x_p."""
    n = len(bins.start)
    for p in range(bounds[0], bounds[1]):
        point = (x[p, 0] + offset[0], x[p, 1] + offset[1], x[p, 2])
        i = floor((point[0] - bins.low[0]) / bins.width[0])
        j = floor((point[1] - bins.low[1]) / bins.width[1])
        number[p] = 0
        if 0 <= i < n and 0 <= j < n:
            for k in range(bins.start[i, j], bins.start[i, j + 1]):
                t = bins.member[k]
                number[p] += _crossing(bins.a[t], bins.b[t], bins.c[t], point)


@parallel
def _winding(x, offset, bins, number):
    for c in prange(CHUNKS):
        _wind(x, offset, bins, number, chunk(c, len(x)))


def winding(x, bins):
    """Return the winding number (N,) of the mesh around points x (N, 3).

    A point of the surface may count either way.
    """
    number = np.zeros(len(x), dtype=np.int64)
    size = (bins.width * len(bins.start)).max()
    _winding(np.ascontiguousarray(x, dtype=float), tuple(s * size for s in OFFSET), bins, number)
    return number


def enclosed_volume(triangles):
    """Return the volume of a closed mesh (M, 3, 3) [m^3], a sum of signed tetrahedra."""
    about = triangles - triangles.mean(axis=(0, 1))
    return float(np.einsum("ma,ma->", about[:, 0], np.cross(about[:, 1], about[:, 2])) / 6.0)


def read_triangles(file):
    """Return the triangles (M, 3, 3) of a closed mesh file (STL, OBJ, PLY, OFF), normals outward.

    Corners at one place are one, whatever their texture or normal. A mesh is closed if each edge
    belongs to as many triangles of one orientation as of the other, also where more than two meet:
    then the winding number is defined. Needs trimesh. Raises ValueError where the file is missing,
    cannot be read, or holds a mesh that is not closed.
    """
    if not Path(file).is_file():
        raise ValueError(f"file = {str(file)!r}: no such file")
    try:
        import trimesh
    except ImportError:
        raise ValueError("reading a mesh needs trimesh: pip install 'mpm_ref[mesh]'") from None
    try:
        mesh = trimesh.load_mesh(file)
    except Exception as fault:      # trimesh has no common class for what unreadable files cause
        raise ValueError(f"file = {str(file)!r}: not a readable mesh ({fault})") from None
    if not len(getattr(mesh, "faces", ())):
        raise ValueError(f"file = {str(file)!r}: holds no triangles")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if unmatched := _open_edges(mesh):
        raise ValueError(f"file = {str(file)!r}: the mesh is not closed, {unmatched} of its edges "
                         "do not join triangles of one orientation; repair it first")
    triangles = np.array(mesh.triangles, dtype=float)
    return triangles if enclosed_volume(triangles) > 0.0 else triangles[:, ::-1].copy()


def _open_edges(mesh):
    """Return the number of edges with more triangles of one orientation than of the other."""
    directed = np.sign(mesh.edges[:, 1] - mesh.edges[:, 0])
    _, edge = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_inverse=True)
    return int(np.count_nonzero(np.bincount(edge.ravel(), weights=directed)))
