"""Structures of arrays: what a particle carries, and what a grid node carries.

A field that a scene does not need has another number of dimensions, which kernels read at compile
time:

* `C` of shape (0,): the transfer keeps no affine field (PIC, FLIP).
* `F` of shape (N,): only J = det F is carried, and `tau` of shape (N,) is isotropic (a fluid).
* `b` of shape (0,): no body force that differs between particles.
* `y` of shape (0, 0): the return map has no memory.
* `f`, `v_old` of shape (0,): the grid needs no forces apart from momenta, nor its velocity before
  forces.
"""

from typing import NamedTuple

import numpy as np

from .jit import kernel
from .tensor import fill, identity, lin, mat, mlin, put_mat, put_vec, trace, vec


class Particles(NamedTuple):
    """Everything carried from step to step; N particles in d dimensions, C-contiguous, index
    first.
    """

    x: np.ndarray       # (N, d)     position [m]
    v: np.ndarray       # (N, d)     velocity [m/s]
    C: np.ndarray       # (N, d, d)  affine velocity field [1/s], or (0,)
    L: np.ndarray       # (N, d, d)  velocity gradient [1/s]; MLS: the same array as C
    F: np.ndarray       # (N, d, d)  elastic deformation gradient, or (N,) its determinant
    tau: np.ndarray     # (N, d, d)  Kirchhoff stress [Pa], or (N,) if isotropic; from F
    m: np.ndarray       # (N,)       mass [kg]
    V0: np.ndarray      # (N,)       volume at rest [m^d]
    y: np.ndarray       # (N,)       yield stress [Pa] if the return map changes it, or (0, 0)
    b: np.ndarray       # (N, d)     body force per mass [m/s^2] where it differs, or (0,)


class Grid(NamedTuple):
    """Nodes at integer multiples of dx: node (i, j[, k]) lies at (origin + (i, j[, k])) dx.

    The number of axes of `m` is the dimension, known when a kernel is compiled.
    """

    m: np.ndarray       # (n1, .., nd)     mass [kg]
    v: np.ndarray       # (n1, .., nd, d)  momentum [kg m/s], after the update velocity [m/s]
    f: np.ndarray       # (n1, .., nd, d)  force [N], or (0,): forces join the momentum at once
    v_old: np.ndarray   # (n1, .., nd, d)  velocity before forces [m/s] (FLIP), or (0,)
    origin: np.ndarray  # (d,)             index of the first node, integer
    dx: float           #                  spacing [m]


class SparseGrid(NamedTuple):
    """Boxes of nodes, far from each other in space, side by side in the arrays of one grid; n boxes
    (see `sparse_grid`). Kernels read it as they read a `Grid`.

    `m` to `v_old` and `dx` are those of a `Grid`; nodes between the boxes have no mass.
    """

    m: np.ndarray
    v: np.ndarray
    f: np.ndarray
    v_old: np.ndarray
    origin: np.ndarray  # (rows, 2 d)  hash table of blocks of nodes (see `block_table`), and what
    #                                  takes the index of a node to its index in the arrays
    dx: float
    first: np.ndarray   # (n, d)       index of the first node of each box, from the world's origin
    place: np.ndarray   # (n, d)       index of this node in the arrays
    size: np.ndarray    # (n, d)       nodes of each box along each axis
    axis: int           #              across which slabs are cut (see `order`)


NONE = np.empty(0)                # a field that is not carried
NO_HISTORY = np.empty((0, 0))     # the same for y, which has one axis when it is carried


@kernel
def growth(L, p, dt, like):
    """I + dt L_p."""
    return mlin(1.0, identity(like), dt, mat(L, p, like))


@kernel
def affine(C, p, like):
    """C_p, or zero where no affine field is carried."""
    if C.ndim == 3:
        return mat(C, p, like)
    else:
        return mlin(0.0, identity(like), 0.0, identity(like))


@kernel
def full(a, p, like):
    """Matrix p of an (N, d, d) field; s I of an isotropic field (N,)."""
    if a.ndim == 3:
        return mat(a, p, like)
    else:
        return mlin(a[p], identity(like), 0.0, identity(like))


@kernel
def body_force(b, p, like):
    """b_p, or zero where no body force is carried."""
    if b.ndim == 2:
        return vec(b, p, like)
    else:
        return fill(0.0, like)


@kernel
def put_affine(C, p, scale, B):
    """C_p = scale B, where an affine field is carried."""
    if C.ndim == 3:
        put_mat(C, p, mlin(scale, B, 0.0, B))


@kernel
def put_full(a, p, A):
    """a[p] = A for an (N, d, d) field, tr A for an isotropic one (N,)."""
    if a.ndim == 3:
        put_mat(a, p, A)
    else:
        a[p] = trace(A)


@kernel
def add_body_force(b, p, m, f):
    """b_p += m f, where a body force is carried."""
    if b.ndim == 2:
        put_vec(b, p, lin(1.0, vec(b, p, f), m, f))
