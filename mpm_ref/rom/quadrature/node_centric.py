"""Sample nodes first: they decide where the quadrature points lie and which points may stand for
the body (LDMW-alg2, LDMW-eq8, LDMW-quad). `lagrangian` and `eulerian` go the other way, from
samples to nodes.

A material point tells a velocity where all of its nodes are sample nodes, so that only nodes which
form whole stencils matter: those of the bases from which every node is one. Quadrature points are
the midpoints of sub-cells that reach such a node; no point is followed, nor its neighbours. Their
weights w_q are volumes of now, and their masses m_q = rho / J_q w_q, as in LDM-alg4; the printed
forces keep J / rho_0, which belongs to masses, beside the volumes (X-cross-11).
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from ...core.grid import extent
from ..kinematics import CLOSE, NoBody
from .eulerian import PER_CELL, Eulerian
from .stencil_overlap import bases


class NodeCentric(NamedTuple):
    """Midpoints of the sub-cells around sample nodes; the other fields are those of `Eulerian`."""

    whole: np.ndarray       # (k, d) bases of which all nodes are sample nodes
    X: np.ndarray
    rho: float
    distance: callable
    seeds: np.ndarray
    dx: float
    degree: int
    per_cell: int = PER_CELL
    close: float = CLOSE

    feather = Eulerian.feather
    cloud, first_guesses, places = Eulerian.cloud, Eulerian.first_guesses, Eulerian.places

    def cells(self, x):
        """All quadrature points (cells, l^d, d) [m] that share a sample node, wherever samples x
        are.
        """
        return Eulerian.cells(self, (self.whole + 0.5 * self.degree) * self.dx)

    def samples(self, g, xhat):
        """Return numbers of the material points that have all their nodes among the sample nodes.
        Raises `NoBody` where there are none, `OutOfRange` where they are nowhere.
        """
        x = g.place(self.X, xhat)
        extent(x)
        at = bases(x, self.dx, self.degree)
        both = np.concatenate([self.whole, at])
        _, number = np.unique(both, axis=0, return_inverse=True)
        found = np.flatnonzero(np.isin(number[len(self.whole):], number[:len(self.whole)]))
        if not len(found):
            raise NoBody(f"none of the {len(at)} material points has all its nodes among the "
                         "sample nodes: choose those near the body, where it is now")
        return found


def node_centric(eulerian, nodes):
    """`NodeCentric` quadrature like an `Eulerian` one, for sample nodes (m, d), integer indices.

    Raises ValueError where they are of another shape or kind, or hold no whole stencil.
    """
    nodes, d = np.asarray(nodes), eulerian.X.shape[1]
    if nodes.ndim != 2 or nodes.shape[1] != d or nodes.dtype.kind not in "iu":
        raise ValueError(f"sample nodes of shape {nodes.shape}, {nodes.dtype}: expected (m, {d}) "
                         "integer indices of nodes")
    whole = whole_stencils(nodes, eulerian.degree)
    if not len(whole):
        side = eulerian.degree + 1
        raise ValueError(f"{len(nodes)} sample nodes without a block of {side}^{d} neighbours: no "
                         "point has all its nodes among them; see `nodes_of`")
    return NodeCentric(whole, *eulerian)


def nodes_of(x, dx, degree):
    """The nodes (m, d) that points at x (n, d) [m] reach, each once, in order."""
    base = np.unique(bases(x, dx, degree), axis=0)
    return np.unique(np.concatenate([base + k for k in stencil(degree, x.shape[1])]), axis=0)


def whole_stencils(nodes, degree):
    """The bases (k, d) from which all nodes base .. base + degree, per axis, are among `nodes`."""
    known, found = set(map(tuple, nodes.tolist())), np.unique(nodes, axis=0)
    for k in stencil(degree, nodes.shape[1]):
        found = found[[tuple(node) in known for node in (found + k).tolist()]]
    return found


def stencil(degree, dim):
    """Offsets of the nodes that a point reaches from its base."""
    return np.array(list(product(range(degree + 1), repeat=dim)))
