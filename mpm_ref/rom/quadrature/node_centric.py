"""Node-centric quadrature: sample nodes are chosen first, and quadrature points and samples follow
(LDMW-alg2, LDMW-eq8, LDMW-quad). In `lagrangian` and `eulerian` the nodes follow from samples.

A material point can be a sample where all of its nodes are sample nodes, so that only nodes which
form full stencils matter. Quadrature points are the midpoints of sub-cells that share such a node;
neither points nor their neighbours are tracked. Their weights w_q are current volumes, and their
masses m_q = rho / J_q w_q, as in LDM-alg4; the printed forces keep a factor J / rho_0, which
belongs to masses, beside the volumes (X-cross-11).
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from ...core.grid import extent
from ..kinematics import CLOSE, NoBody
from .eulerian import PER_CELL, WHOLE, Eulerian
from .stencil_overlap import bases


class NodeCentric(NamedTuple):
    """Midpoints of the sub-cells around sample nodes; the other fields are those of `Eulerian`."""

    full_bases: np.ndarray  # (k, d) bases of which all nodes are sample nodes
    X: np.ndarray
    rho: float
    distance: callable
    seeds: np.ndarray
    dx: float
    degree: int
    per_cell: int = PER_CELL
    close: float = CLOSE
    boundary_cells: str = WHOLE

    feather = Eulerian.feather
    cloud, parts = Eulerian.cloud, Eulerian.parts
    first_guesses, places = Eulerian.first_guesses, Eulerian.places

    def cells(self, x):
        """Return all quadrature points (cells, l^d, d) [m] that share a sample node; positions x of
        samples are not used.
        """
        return Eulerian.cells(self, (self.full_bases + 0.5 * self.degree) * self.dx)

    def samples(self, g, xhat):
        """Return numbers of the material points that have all their nodes among the sample nodes.
        Raises `NoBody` where there are none, `OutOfRange` where positions are not finite.
        """
        x = g.place(self.X, xhat)
        extent(x)
        k = len(self.full_bases)
        both = np.concatenate([self.full_bases, bases(x, self.dx, self.degree)])
        _, number = np.unique(both, axis=0, return_inverse=True)
        samples = np.flatnonzero(np.isin(number[k:], number[:k]))
        if not len(samples):
            raise NoBody(f"none of the {len(x)} material points has all its nodes among the "
                         "sample nodes: choose those near the body, where it is now")
        return samples


def node_centric(eulerian, nodes):
    """Return the `NodeCentric` quadrature for sample nodes (m, d), integer indices, with the other
    data of an `Eulerian` one.

    Raises ValueError where nodes are of another shape or type, or hold no full stencil.
    """
    nodes, d = np.asarray(nodes), eulerian.X.shape[1]
    if nodes.ndim != 2 or nodes.shape[1] != d or nodes.dtype.kind not in "iu":
        raise ValueError(f"sample nodes of shape {nodes.shape}, {nodes.dtype}: expected (m, {d}) "
                         "integer indices of nodes")
    full_bases = full_stencils(nodes, eulerian.degree)
    if not len(full_bases):
        side = eulerian.degree + 1
        raise ValueError(f"{len(nodes)} sample nodes without a block of {side}^{d} neighbours: no "
                         "point has all its nodes among them; see `nodes_of`")
    return NodeCentric(full_bases, *eulerian)


def nodes_of(x, dx, degree):
    """Return the nodes (m, d) in the stencils of points at x (n, d) [m], each once, in order."""
    base = np.unique(bases(x, dx, degree), axis=0)
    return np.unique(np.concatenate([base + k for k in stencil(degree, x.shape[1])]), axis=0)


def full_stencils(nodes, degree):
    """Return the bases (k, d) whose nodes base .. base + degree, per axis, are all in `nodes`."""
    given, full = set(map(tuple, nodes.tolist())), np.unique(nodes, axis=0)
    for k in stencil(degree, nodes.shape[1]):
        full = full[[tuple(node) in given for node in (full + k).tolist()]]
    return full


def stencil(degree, dim):
    """Return the offsets of a point's nodes from its base."""
    return np.array(list(product(range(degree + 1), repeat=dim)))
