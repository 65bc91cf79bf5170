"""Position, stress and affine field of material points as sums of fixed modes, whose coefficients
are smooth functions of a few latent coordinates: NSF's three fields without networks.

    x_p   = X_p + sum_k a_k(xhat) U_kp,       a_k = xhat_k for k < r                      NSF-eq8
    tau_p = sum_k s_k(xhat, mu) T_kp                                       NSF-eq9, NSF-mu-dep
    C_p   = sum_k c_k(xhat) B_kp                                                      NSF-sec4.4

Modes are the proper orthogonal ones of each field's snapshots, coefficients `radial` functions
through theirs. They are made by linear algebra alone, and a point costs a product with as many
numbers as there are modes, where the networks of the paper cost some millions of operations. They
are known at the points of the data only, which are named by their numbers.
"""

from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...core.blas import one_thread
from ...core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..symmetric import tensor
from .radial_basis import SMOOTHING, Radial, through

LEAST = 1e-13           # square of a singular value over the largest: modes below are round-off
COLUMNS = 20000         # of snapshots at a time


class Part(NamedTuple):
    """A field as a sum of modes."""

    modes: np.ndarray       # (n, k, R) of k values at n points
    coefficients: Radial    # (R,) of latent coordinates, and of parameters if it has any

    def at(self, points, y):
        """Its values (m, k) at points of these numbers."""
        return combined(self.modes, points, self.coefficients.value(y))


class Cells(NamedTuple):
    """Points in blocks of the body at rest, and how far modes can take them apart."""

    order: np.ndarray       # (n,) points of block b: order[start[b] : start[b + 1]]
    start: np.ndarray       # (blocks + 1,)
    middle: np.ndarray      # (blocks,) number of a point in the middle of each
    rest: np.ndarray        # (blocks,) largest distance of a point from it along an axis [m]
    spread: np.ndarray      # (blocks, R) ... of their displacements in each mode, per coefficient

    def near(self, x, at, a, distance):
        """Numbers of all points that may be within a distance [m], by the largest axis, of one of
        the positions x (m, d), where the middles lie `at` (blocks, d) with coefficients a (R,).
        """
        gap, _ = KDTree(x).query(at, p=np.inf)
        found = np.flatnonzero(gap <= distance + self.rest + self.spread @ np.abs(a))
        parts = [self.order[self.start[b]:self.start[b + 1]] for b in found]
        return np.concatenate([self.order[:0], *parts])


class Spanned(NamedTuple):
    """The three fields at the points of their data, in a run with parameters mu."""

    X: np.ndarray           # (n, d) at rest [m]
    U: np.ndarray           # (n, d, R) modes of the displacement; coefficients [m]
    bend: Radial | None     # coefficients of the modes beyond the first r; None: there are none
    tau: Part               # values of `symmetric`
    C: Part | None          # None: no affine field
    mu: np.ndarray          # (parameters,) that the stress depends on
    cells: Cells

    @property
    def dim(self):
        """Number of axes d."""
        return self.X.shape[1]

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.U.shape[2] if self.bend is None else len(self.bend.unit)

    def all(self, xhat):
        """Coefficients (R,) of all modes of the displacement."""
        return xhat if self.bend is None else np.concatenate([xhat, self.bend.value(xhat)])

    def rates(self, xhat):
        """Their derivatives (R, r)."""
        own = np.eye(self.r)
        return own if self.bend is None else np.vstack([own, self.bend.slope(xhat)])

    def place(self, points, xhat):
        """x (m, d) [m] of points of these numbers."""
        return self.X[points] + combined(self.U, points, self.all(xhat))

    def derivatives(self, points, xhat):
        """x (m, d), None (no gradient is known in between points), and dg/dxhat (m, d, r)."""
        return self.place(points, xhat), None, self.U[points] @ self.rates(xhat)

    def stress(self, points, xhat, F=None):
        """Return the Kirchhoff stress (m, d, d) [Pa]; F is of no use to it."""
        return tensor(self.tau.at(points, np.concatenate([xhat, self.mu])), self.dim)

    def affine(self, points, xhat):
        """C (m, d, d) [1/s]."""
        if self.C is None:
            return np.zeros((len(points), self.dim, self.dim))
        return self.C.at(points, xhat).reshape(-1, self.dim, self.dim)

    def near(self, xhat, x, distance):
        """Numbers of all points that may be within a distance [m], by the largest axis, of one of
        the positions x (m, d).
        """
        at = self.place(self.cells.middle, xhat)
        return self.cells.near(x, at, self.all(xhat), distance)

    def of(self, mu):
        """The fields in a run with other parameters."""
        return self._replace(mu=np.array(mu, dtype=float))

    def single(self):
        """The fields with modes in single precision, of which half as much must be read; sums are
        of doubles as before.
        """
        U, cells = self.U.astype(np.float32), self.cells
        parts = [part and part._replace(modes=part.modes.astype(np.float32))
                 for part in (self.tau, self.C)]
        return self._replace(U=U, tau=parts[0], C=parts[1],
                             cells=cells._replace(spread=spreads(U, *cells[:3])))


class Sizes(NamedTuple):
    """Numbers of latent coordinates and of modes."""

    r: int
    modes: int = 20         # of the displacement, the first r of them free
    tau: int = 40
    C: int = 40             # 0: no affine field
    weight: float = 1.0     # of parameters beside latent coordinates: spread for spread
    smoothing: float = SMOOTHING    # of coefficients as functions of latent coordinates


def spanned(histories, sizes, size, follows=True, known=None):
    """`Spanned` fields of `Histories` (their first run's parameters), and the latent coordinates
    (s, k + 1, r) of the snapshots; size [m] of blocks.

    follows: whether the stress depends on the parameters too; known: {(name, count): modes and
    coefficients} of these histories, kept from one call to the next. Raises ValueError for more
    modes than the snapshots hold.
    """
    s, levels, n, d = histories.x.shape
    x = histories.x.reshape(s * levels, -1)
    U, a = once(known, x, sizes.modes, "modes", histories.X.ravel())
    xhat, mu = a[:, :sizes.r], np.repeat(histories.mu, levels, axis=0)
    unit = np.full(sizes.r, np.sqrt(np.mean(xhat[:, 0] ** 2)))
    own = mu[:, :mu.shape[1] if follows else 0]
    units = np.concatenate([unit, spread_of(own) / sizes.weight])
    fit = partial(through, smoothing=sizes.smoothing)
    bend = fit(xhat, a[:, sizes.r:], unit) if sizes.modes > sizes.r else None
    find = partial(part, known=known)
    tau = find(histories.tau, sizes.tau, "tau", lambda a: fit(np.hstack([xhat, own]), a, units))
    C = find(histories.C, sizes.C, "C", lambda a: fit(xhat, a, unit)) if sizes.C else None
    U = np.ascontiguousarray(U.reshape(n, d, -1))
    fields = Spanned(histories.X, U, bend, tau, C, own[0], cells(histories.X, U, size))
    return fields, xhat.reshape(s, levels, -1)


def part(snapshots, count, name, fit, known=None):
    """`Part` with so many modes of snapshots (s, levels, n, k), whose coefficients (s levels, R)
    are made functions by `fit`; known: as of `once`.
    """
    s, levels, n, k = snapshots.shape
    modes, a = once(known, snapshots.reshape(s * levels, n * k), count, name)
    return Part(np.ascontiguousarray(modes.reshape(n, k, -1)), fit(a))


def once(known, A, count, name, origin=None):
    """What `modes_of` gives: what is known, {(name, count): modes and coefficients} or None, is not
    found again, and what is found is put there.
    """
    if known is None:
        return modes_of(A, count, name, origin)
    if (name, count) not in known:
        known[name, count] = modes_of(A, count, name, origin)
    return known[name, count]


def spread_of(mu):
    """Standard deviation of each parameter; 1 where it does not vary."""
    spread = mu.std(axis=0)
    return np.where(spread > 0.0, spread, 1.0)


def modes_of(A, count, name, origin=None):
    """The `count` leading orthonormal modes (N, count) of rows A (m, N), less an origin (N,) if one
    is given, and the rows' coefficients (m, count), from the rows' products: there are far fewer
    rows than columns. Sums are of doubles whatever the rows are, of which some columns at a time
    are read. Raises ValueError for more modes than the rows hold.
    """
    def columns():
        for k in range(0, A.shape[1], COLUMNS):
            block = slice(k, k + COLUMNS)
            some = A[:, block].astype(float)
            yield some if origin is None else some - origin[block]

    with one_thread():
        products = np.zeros((len(A), len(A)))
        for some in columns():
            products += some @ some.T
        square, vectors = np.linalg.eigh(products)
        square, vectors = square[::-1], vectors[:, ::-1]
        held = int(np.sum(square > LEAST * square[0])) if square[0] > 0.0 else 0
        if not 1 <= count <= held:
            raise ValueError(f"{name} = {count}: expected 1 .. {held}, as many modes as the "
                             f"{len(A)} snapshots hold")
        sigma = np.sqrt(square[:count])
        found = [some.T @ vectors[:, :count] / sigma for some in columns()]
    return np.concatenate(found), vectors[:, :count] * sigma


def cells(X, U, size):
    """`Cells` of cubes of a size [m] of points X (n, d) with modes U (n, d, R)."""
    _, block = np.unique(np.floor(X / size).astype(np.int64), axis=0, return_inverse=True)
    order = np.argsort(block, kind="stable")
    count = np.bincount(block)
    start = np.concatenate(([0], np.cumsum(count)))
    center = np.stack([np.bincount(block, X[:, a]) / count for a in range(X.shape[1])], axis=1)
    off = np.linalg.norm(X - center[block], axis=1)
    middle = np.array([order[b:e][np.argmin(off[order[b:e]])]
                       for b, e in pairwise(start)])
    rest = spreads(X[..., None], order, start, middle)[:, 0]
    return Cells(order, start, middle, rest, spreads(U, order, start, middle))


def spreads(U, order, start, middle):
    """Largest difference (blocks, R) of values U (n, d, R) along an axis from those of the middle
    of a block.
    """
    block = np.repeat(np.arange(len(middle)), np.diff(start))
    far = np.abs(U[order] - U[middle][block]).max(axis=1).astype(float)
    return np.maximum.reduceat(far, start[:-1], axis=0)


def combined(modes, points, a):
    """sum_r modes[points, :, r] a_r (m, k), of modes (n, k, R) with coefficients a (R,). Raises
    ValueError for another number of coefficients than of modes.
    """
    if len(a) != modes.shape[2]:
        raise ValueError(f"{len(a)} coefficients for {modes.shape[2]} modes: expected as many")
    out = np.empty((len(points), modes.shape[1]))
    _combine(modes, np.asarray(points), np.ascontiguousarray(a), out)
    return out


@parallel
def _combine(modes, points, a, out):
    for c in prange(CHUNKS):
        combine(modes, points, a, out, chunk(c, len(points)))


@kernel
def combine(modes, points, a, out, bounds):
    """The sums of some points; four terms at a time, as a sum that waits for itself is slow."""
    whole = len(a) - len(a) % 4
    for i in range(bounds[0], bounds[1]):
        p = points[i]
        for k in range(out.shape[1]):
            s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
            for r in range(0, whole, 4):
                s0 += modes[p, k, r] * a[r]
                s1 += modes[p, k, r + 1] * a[r + 1]
                s2 += modes[p, k, r + 2] * a[r + 2]
                s3 += modes[p, k, r + 3] * a[r + 3]
            for r in range(whole, len(a)):
                s0 += modes[p, k, r] * a[r]
            out[i, k] = (s0 + s1) + (s2 + s3)
