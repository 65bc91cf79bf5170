"""Position, stress and affine field of material points as sums of fixed modes, whose coefficients
are smooth functions of a few latent coordinates: NSF's three fields without networks.

    x_p   = X_p + sum_k a_k(xhat) U_kp,       a_k = xhat_k for k < r                      NSF-eq8
    tau_p = sum_k s_k(xhat, mu) T_kp                                       NSF-eq9, NSF-mu-dep
    C_p   = sum_k c_k(xhat) B_kp                                                      NSF-sec4.4

Modes are the proper orthogonal modes of each field's snapshots, and coefficients are radial basis
functions through those of the snapshots (`radial_basis`). They are computed by linear algebra
alone, and a point costs a product with as many numbers as there are modes, where the networks of
the paper cost some millions of operations. Modes have values at the points of the data only, which
are referred to by their numbers.
"""

from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...core.blas import one_thread
from ...core.jit import CHUNKS, chunk, kernel, parallel, prange
from ...core.prefetch import LINE, prefetch
from ..symmetric import tensor
from .blocks import group, points_of_blocks
from .radial_basis import SMOOTHING, Radial, through

LEAST = 1e-13           # square of a singular value over the largest: modes below are round-off
COLUMNS = 20000         # of snapshots at a time
AHEAD = 8192            # bytes of modes that are read ahead


class ModalField(NamedTuple):
    """A field as a sum of modes."""

    modes: np.ndarray       # (n, k, R) of k values at n points
    coefficients: Radial    # (R,) of latent coordinates, and of parameters if it has any

    def values(self, points, y):
        """Return the values (m, k) at points of these numbers."""
        return combined(self.modes, points, self.coefficients.value(y))


class Cells(NamedTuple):
    """Points in blocks of the body at rest, with bounds of their distances in motion."""

    order: np.ndarray       # (n,) points of block b: order[start[b] : start[b + 1]]
    start: np.ndarray       # (blocks + 1,)
    middle: np.ndarray      # (blocks,) number of a point in the middle of each
    rest: np.ndarray        # (blocks,) largest distance of a point from it along an axis [m]
    spread: np.ndarray      # (blocks, R) ... of their displacements in each mode, per coefficient

    def near(self, x, middles, a, distance):
        """Return numbers of all points that may be within a distance [m], by the largest axis, of
        one of the positions x (m, d).

        middles (blocks, d): positions of the points in the middle of the blocks [m], at
        coefficients a (R,) of the modes.
        """
        gap, _ = KDTree(x).query(middles, p=np.inf)
        near = np.flatnonzero(gap <= distance + self.rest + self.spread @ np.abs(a))
        return points_of_blocks(self.order, self.start, near)


class PodFields(NamedTuple):
    """The three fields at the points of their data, in a run with parameters mu."""

    X: np.ndarray           # (n, d) at rest [m]
    U: np.ndarray           # (n, d, R) modes of the displacement; coefficients [m]
    bend: Radial | None     # coefficients of the modes beyond the first r; None: there are none
    tau: ModalField         # values of `symmetric`
    C: ModalField | None    # None: no affine field
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
        """Return the coefficients (R,) of all modes of the displacement."""
        return xhat if self.bend is None else np.concatenate([xhat, self.bend.value(xhat)])

    def rates(self, xhat):
        """Return the derivatives (R, r) of the coefficients by xhat."""
        unit = np.eye(self.r)
        return unit if self.bend is None else np.vstack([unit, self.bend.slope(xhat)])

    def place(self, points, xhat):
        """Return x (m, d) [m] of points of these numbers."""
        x = combined(self.U, points, self.all(xhat))
        x += self.X.take(points, axis=0)
        return x

    def derivatives(self, points, xhat):
        """Return x (m, d), None (there is no gradient between points), and dg/dxhat (m, d, r)."""
        return self.place(points, xhat), None, self.U[points] @ self.rates(xhat)

    def stress(self, points, xhat, F=None):
        """Return the Kirchhoff stress (m, d, d) [Pa]; F is not used."""
        return tensor(self.tau.values(points, np.concatenate([xhat, self.mu])), self.dim)

    def affine(self, points, xhat):
        """Return the affine velocity field C (m, d, d) [1/s]."""
        if self.C is None:
            return np.zeros((len(points), self.dim, self.dim))
        return self.C.values(points, xhat).reshape(-1, self.dim, self.dim)

    def near(self, xhat, x, distance):
        """Return numbers of all points that may be within a distance [m], by the largest axis, of
        one of the positions x (m, d).
        """
        middles = self.place(self.cells.middle, xhat)
        return self.cells.near(x, middles, self.all(xhat), distance)

    def with_parameters(self, mu):
        """Return the fields in a run with parameters mu."""
        return self._replace(mu=np.array(mu, dtype=float))

    def single(self):
        """Return the fields with modes in single precision, which halves the memory read; sums are
        in double precision.
        """
        U, cells = self.U.astype(np.float32), self.cells
        tau, C = (field and field._replace(modes=field.modes.astype(np.float32))
                  for field in (self.tau, self.C))
        return self._replace(U=U, tau=tau, C=C,
                             cells=cells._replace(spread=spreads(U, *cells[:3])))


class Sizes(NamedTuple):
    """Numbers of latent coordinates and of modes."""

    r: int
    modes: int = 20         # of the displacement, the first r of them free
    tau: int = 40
    C: int = 40             # 0: no affine field
    weight: float = 1.0     # of parameters beside latent coordinates: spread for spread
    smoothing: float = SMOOTHING    # of coefficients as functions of latent coordinates


def fit_pod_fields(histories, sizes, size, follows=True, cache=None):
    """Return the `PodFields` of `Histories`, with the parameters of the first run, and the latent
    coordinates (s, k + 1, r) of the snapshots; size [m] of blocks.

    follows: whether the stress depends on the parameters too; cache: {(name, count): modes and
    coefficients} of these histories, for further calls. Raises ValueError for more modes than the
    snapshots hold.
    """
    s, levels, n, d = histories.x.shape
    x = histories.x.reshape(s * levels, -1)
    U, a = cached_modes(cache, x, sizes.modes, "modes", histories.X.ravel())
    xhat, mu = a[:, :sizes.r], np.repeat(histories.mu, levels, axis=0)
    unit = np.full(sizes.r, np.sqrt(np.mean(xhat[:, 0] ** 2)))
    mu = mu[:, :mu.shape[1] if follows else 0]
    units = np.concatenate([unit, spread_of(mu) / sizes.weight])
    fit = partial(through, smoothing=sizes.smoothing)
    bend = fit(xhat, a[:, sizes.r:], unit) if sizes.modes > sizes.r else None
    modal = partial(fit_modal_field, cache=cache)
    tau = modal(histories.tau, sizes.tau, "tau", lambda a: fit(np.hstack([xhat, mu]), a, units))
    C = modal(histories.C, sizes.C, "C", lambda a: fit(xhat, a, unit)) if sizes.C else None
    U = np.ascontiguousarray(U.reshape(n, d, -1))
    fields = PodFields(histories.X, U, bend, tau, C, mu[0], cells(histories.X, U, size))
    return fields, xhat.reshape(s, levels, -1)


def fit_modal_field(snapshots, count, name, fit, cache=None):
    """Return the `ModalField` with `count` modes of snapshots (s, levels, n, k).

    fit: makes a function of latent coordinates through the modes' coefficients (s levels, R);
    cache: see `cached_modes`.
    """
    s, levels, n, k = snapshots.shape
    modes, a = cached_modes(cache, snapshots.reshape(s * levels, n * k), count, name)
    return ModalField(np.ascontiguousarray(modes.reshape(n, k, -1)), fit(a))


def cached_modes(cache, A, count, name, origin=None):
    """Return `modes_of` these arguments from the cache, {(name, count): modes and coefficients} or
    None; compute and store them where it lacks them.
    """
    if cache is None:
        return modes_of(A, count, name, origin)
    if (name, count) not in cache:
        cache[name, count] = modes_of(A, count, name, origin)
    return cache[name, count]


def spread_of(mu):
    """Return the standard deviation of each parameter; 1 where it does not vary."""
    spread = mu.std(axis=0)
    return np.where(spread > 0.0, spread, 1.0)


def modes_of(A, count, name, origin=None):
    """Return the `count` leading orthonormal modes (N, count) of rows A (m, N), less an origin (N,)
    if one is given, and the rows' coefficients (m, count).

    They follow from the products of the rows, which are far fewer than the columns. Sums are in
    double precision whatever the rows are, whose columns are read block by block. Raises ValueError
    for more modes than the rows hold.
    """
    def columns():
        for k in range(0, A.shape[1], COLUMNS):
            block = slice(k, k + COLUMNS)
            values = A[:, block].astype(float)
            yield values if origin is None else values - origin[block]

    with one_thread():
        products = np.zeros((len(A), len(A)))
        for values in columns():
            products += values @ values.T
        square, vectors = np.linalg.eigh(products)
        square, vectors = square[::-1], vectors[:, ::-1]
        rank = int(np.sum(square > LEAST * square[0])) if square[0] > 0.0 else 0
        if not 1 <= count <= rank:
            raise ValueError(f"{name} = {count}: expected 1 .. {rank}, as many modes as the "
                             f"{len(A)} snapshots hold")
        sigma = np.sqrt(square[:count])
        modes = [values.T @ vectors[:, :count] / sigma for values in columns()]
    return np.concatenate(modes), vectors[:, :count] * sigma


def cells(X, U, size):
    """Return the `Cells` of cubes of a size [m] of points X (n, d) with modes U (n, d, R)."""
    order, start, _, distance = group(X, size)
    middle = np.array([order[b:e][np.argmin(distance[order[b:e]])] for b, e in pairwise(start)])
    rest = spreads(X[..., None], order, start, middle)[:, 0]
    return Cells(order, start, middle, rest, spreads(U, order, start, middle))


def spreads(U, order, start, middle):
    """Return the largest difference (blocks, R) of values U (n, d, R) along an axis from those of
    the middle of a block.
    """
    block = np.repeat(np.arange(len(middle)), np.diff(start))
    far = np.abs(U[order] - U[middle][block]).max(axis=1).astype(float)
    return np.maximum.reduceat(far, start[:-1], axis=0)


def combined(modes, points, a):
    """Return sum_r modes[points, :, r] a_r (m, k), of modes (n, k, R) with coefficients a (R,).
    Raises ValueError for another number of coefficients than of modes.
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
    """Compute the sums of points bounds[0] .. bounds[1] - 1, four terms at a time: a single running
    sum would wait for each addition. Modes of the points some places on are read ahead.
    """
    fours = len(a) - len(a) % 4
    numbers = modes.shape[1] * modes.shape[2]
    ahead = 1 + AHEAD // (numbers * modes.itemsize)
    for i in range(bounds[0], bounds[1]):
        p = points[i]
        if i + ahead < len(points):
            first = points[i + ahead] * numbers
            for start in range(first, first + numbers, LINE // modes.itemsize):
                prefetch(modes, start)
        for k in range(out.shape[1]):
            s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
            for r in range(0, fours, 4):
                s0 += modes[p, k, r] * a[r]
                s1 += modes[p, k, r + 1] * a[r + 1]
                s2 += modes[p, k, r + 2] * a[r + 2]
                s3 += modes[p, k, r + 3] * a[r + 3]
            for r in range(fours, len(a)):
                s0 += modes[p, k, r] * a[r]
            out[i, k] = (s0 + s1) + (s2 + s3)
