"""Plane strain, linear elastic, by mixed finite elements that do not lock: a reference.

Taylor-Hood elements: displacements u of degree 2, pressures p of degree 1, on a mapped square of
quadrilaterals [Hughes2000]. With the body force b [N/m^2 per depth],

    2 mu (eps(u), eps(w)) - (p, div w) = (b, w),      (div u, q) + (p, q)/lam = 0

for all w and q. Integrals by 3 x 3 Gauss points.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import bmat, csr_matrix
from scipy.sparse.linalg import spsolve

GAUSS = np.polynomial.legendre.leggauss(3)


class Quadrilaterals(NamedTuple):
    """Quadrilaterals on a grid of n x n; nodes come row by row, and so do corners."""

    X: np.ndarray           # (K, 2)   nodes of degree 2 [m]; K = (2 n + 1)^2
    nodes: np.ndarray       # (n^2, 9) of each element
    corners: np.ndarray     # (n^2, 4) of each element, numbers among the (n + 1)^2 corners
    n: int


class MixedSolution(NamedTuple):
    """Displacements and pressures of a mesh."""

    mesh: Quadrilaterals
    u: np.ndarray           # (K, 2)         [m]
    p: np.ndarray           # (n + 1, n + 1) at the corners [Pa]
    b: np.ndarray           # (K, 2)         consistent nodal loads [N/m]
    V: np.ndarray           # (K,)           areas of the nodes, sum of rows [m^2]

    @property
    def displacement(self):
        """Return the mean displacement along a vertical load [m]: its work over its resultant."""
        return float((self.b * self.u).sum() / self.b[:, 1].sum())

    def frequency(self, rho):
        """Return Rayleigh's quotient of the displacement as an estimate of the lowest frequency
        [1/s], for the density rho [kg/m^2].
        """
        return float(np.sqrt((self.b * self.u).sum() / (rho * self.V @ (self.u**2).sum(axis=1))))


def mapped_square(mapping, n):
    """Return the `Quadrilaterals` of n x n elements; mapping(s, t) gives x and y of points of the
    unit square.
    """
    m = 2 * n + 1
    s, t = np.meshgrid(np.linspace(0.0, 1.0, m), np.linspace(0.0, 1.0, m), indexing="ij")
    i, j = (a.ravel()[:, None] for a in np.meshgrid(range(n), range(n), indexing="ij"))
    a, b = (k.ravel() for k in np.meshgrid(range(3), range(3), indexing="ij"))
    c, d = (k.ravel() for k in np.meshgrid(range(2), range(2), indexing="ij"))
    return Quadrilaterals(np.stack(mapping(s.ravel(), t.ravel()), axis=-1),
                (2 * i + a) * m + 2 * j + b, (i + c) * (n + 1) + j + d, n)


def quadratic(x):
    """Return the shape functions (3,) of degree 2 at x in [-1, 1], and their slopes."""
    slopes = np.array([x - 0.5, -2.0 * x, x + 0.5])
    return np.array([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2]), slopes


def linear(x):
    """Return the shape functions (2,) of degree 1 at x in [-1, 1]."""
    return np.array([(1 - x) / 2, (1 + x) / 2])


def elements(mesh, mu, load):
    """Return the integrals over each element: stiffness (n^2, 18, 18) of the shear, divergence
    (n^2, 18, 4), mass of pressures (n^2, 4, 4), loads (n^2, 9, 2) and areas (n^2, 9) of the nodes.
    """
    X, count = mesh.X[mesh.nodes], len(mesh.nodes)
    K, B = np.zeros((count, 18, 18)), np.zeros((count, 18, 4))
    M, b, V = np.zeros((count, 4, 4)), np.zeros((count, 9, 2)), np.zeros((count, 9))
    for x, w_x in zip(*GAUSS, strict=True):
        for y, w_y in zip(*GAUSS, strict=True):
            (N_x, D_x), (N_y, D_y) = quadratic(x), quadratic(y)
            N, P = np.outer(N_x, N_y).ravel(), np.outer(linear(x), linear(y)).ravel()
            D = np.stack([np.outer(D_x, N_y).ravel(), np.outer(N_x, D_y).ravel()], axis=1)
            J = np.einsum("eni,nk->eik", X, D)
            w = np.linalg.det(J) * w_x * w_y
            G = np.einsum("nk,eki->eni", D, np.linalg.inv(J))
            strain = strains(G)
            K += np.einsum("e,eai,a,eaj->eij", w, strain, mu * np.array([2.0, 2.0, 1.0]), strain)
            B += np.einsum("e,ei,j->eij", w, G.reshape(count, 18), P)
            M += np.einsum("e,i,j->eij", w, P, P)
            b += np.einsum("e,n,ei->eni", w, N, load(np.einsum("n,eni->ei", N, X)))
            V += np.einsum("e,n->en", w, N)
    return K, B, M, b, V


def strains(G):
    """Return the matrices (.., 3, 18) from displacements to eps_xx, eps_yy, 2 eps_xy of slopes G
    (.., 9, 2) of the shape functions.
    """
    strain = np.zeros((len(G), 3, 18))
    strain[:, 0, 0::2], strain[:, 1, 1::2] = G[:, :, 0], G[:, :, 1]
    strain[:, 2, 0::2], strain[:, 2, 1::2] = G[:, :, 1], G[:, :, 0]
    return strain


def summed(A, rows, columns, shape):
    """Return the sparse matrix of a shape that sums the matrices A (E, a, b) of elements."""
    rows, columns = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
    return csr_matrix((A.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def solve(mesh, moduli, fixed, load):
    """Return the `MixedSolution` under load(x), a body force (.., 2) [N/m^2] at places (.., 2) [m].

    moduli is (mu, lam) [Pa]; fixed(X) tells which displacements (K, 2) are zero.
    """
    mu, lam = moduli
    K, B, M, b, V = elements(mesh, mu, load)
    count, corners = len(mesh.X), (mesh.n + 1) ** 2
    u_of = np.stack([2 * mesh.nodes, 2 * mesh.nodes + 1], axis=-1).reshape(-1, 18)
    K = summed(K, u_of, u_of, (2 * count, 2 * count))
    B = summed(B, u_of, mesh.corners, (2 * count, corners))
    M = summed(M, mesh.corners, mesh.corners, (corners, corners))
    loads = np.zeros((count, 2))
    np.add.at(loads, mesh.nodes, b)
    free = np.flatnonzero(~fixed(mesh.X).ravel())
    system = bmat([[K[free][:, free], -B[free]], [-B[free].T, -M / lam]]).tocsc()
    unknowns = spsolve(system, np.concatenate([loads.ravel()[free], np.zeros(corners)]))
    u = np.zeros(2 * count)
    u[free] = unknowns[: len(free)]
    area = np.zeros(count)
    np.add.at(area, mesh.nodes, V)
    p = unknowns[len(free):].reshape(mesh.n + 1, mesh.n + 1)
    return MixedSolution(mesh, u.reshape(-1, 2), p, loads, area)
