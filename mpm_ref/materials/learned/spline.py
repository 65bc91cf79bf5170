"""Cubic pieces through values at knots, the functions of the paper's baseline "spline".

    y_i = f(s_i) + sum_j g(s_i s_j) s_j + h(J) J/s_i,    j != i,  J = prod s_k

is P in principal stretches of an energy F(s_i) + G(s_i s_j) + H(J) summed over axes and pairs, in
3D; f, g, h are its derivatives. Each is given by values at 21 knots, 11 on [0, 1] and 11 on [1, 10]
evenly, in Bezier pieces (NCLAW-methods says quadratic, the authors' release has cubics). As a
piece depends on the values linearly, each reading of the pieces is a constant table (`Pieces`):

`fair`      Hermite cubics whose slope at a knot is that of the parabola through it and its
            neighbours: they have a continuous derivative and are exact for parabolas.
`released`  as the release evaluates them. Its cubics are intended to be such Hermite cubics on
            evenly spaced knots, with other slopes at the ends. But its Bernstein matrix has -1
            instead of +1 for the constant term; for numbers up to 0.8 it takes the piece after
            the right one, and above that the piece of [0.9, 1]. So the function jumps at 0, 0.1,
            .., 0.8, uses 12 of the 21 values, and only the four at 0.8, 0.9, 1 and 1.9 where
            stretches stay above 0.8.

Beyond the knots the last piece continues.
"""

from typing import NamedTuple

import numpy as np

from ...core import law as registry
from ...core.jit import kernel
from .principal import kirchhoff, stretch_response

SIDE = 10               # intervals on each side of 1
LARGEST = 10.0          # knot
BERNSTEIN = np.array([[-1.0, 3.0, -3.0, 1.0], [3.0, -6.0, 3.0, 0.0], [-3.0, 3.0, 0.0, 0.0],
                      [1.0, 0.0, 0.0, 0.0]])    # powers 3 .. 0 of Bezier points


class SplineStress(NamedTuple):
    """Kirchhoff stress of `fair` splines; values at knots are (21, 3), of f, g, h.

    With values in kPa, a learning rate of 1 suits the stiffness of the paper's materials.
    """

    unit: float = 1e3       # of the values [Pa]


class ReleasedSplineStress(NamedTuple):
    """Kirchhoff stress of `released` splines, in Pa: a rate of 1 moves the values by 150 of 1e4 at
    most.
    """

    unit: float = 1.0       # of the values [Pa]


class Pieces(NamedTuple):
    """The pieces of a function of values at knots.

    Piece k, of as many breaks below x, is sum_m c_m (x - origin_k)^m with c = basis[k] @ values and
    m = 3 .. 0.
    """

    breaks: np.ndarray      # (p - 1,)
    origins: np.ndarray     # (p,)
    basis: np.ndarray       # (p, 4, knots)


class SplineLaw(NamedTuple):
    """f, g, h as pieces (see `Pieces`); 3D."""

    breaks: np.ndarray      # (p - 1,)
    origins: np.ndarray     # (p,)
    tables: np.ndarray      # (3, p, 4) coefficients of powers 3 .. 0 [Pa]


def knots():
    """Return the 21 knots, ascending."""
    return np.concatenate([np.linspace(0.0, 1.0, SIDE + 1),
                           np.linspace(1.0, LARGEST, SIDE + 1)[1:]])


def fair(x):
    """Return the `Pieces` with a continuous derivative, of knots x."""
    width, slopes = np.diff(x), parabola_slopes(x)
    at = np.eye(len(x))
    left = at[:-1] + width[:, None] / 3.0 * slopes[:-1]
    right = at[1:] - width[:, None] / 3.0 * slopes[1:]
    points = np.stack([at[:-1], left, right, at[1:]], axis=1)
    return Pieces(x[1:-1], x[:-1], in_powers(BERNSTEIN, points, width))


def parabola_slopes(x):
    """Return the matrix (knots, knots) from values to slopes at knots x."""
    n, slopes = len(x), np.zeros((len(x), len(x)))
    for k in range(n):
        i = np.clip(k, 1, n - 2) + np.arange(-1, 2)
        for m in range(3):
            a, b = np.delete(x[i], m)
            slopes[k, i[m]] = (2.0 * x[k] - a - b) / ((x[i[m]] - a) * (x[i[m]] - b))
    return slopes


def released(x):
    """Return the `Pieces` as the authors' release evaluates them; of knots x the middle one
    is 1.
    """
    side, at = len(x) // 2, np.eye(len(x))
    inner = (at[2:] - at[:-2]) / 6.0
    left = np.vstack([(2.0 * at[0] + 2.0 * at[1] - at[2]) / 3.0, at[1:-1] + inner])
    right = np.vstack([at[1:-1] - inner, (2.0 * at[-1] + 2.0 * at[-2] - at[-3]) / 3.0])
    points = np.stack([at[:-1], left, right, at[1:]], axis=1)[:side]
    wrong = BERNSTEIN * np.array([1.0, 1.0, 1.0, -1.0])[:, None]
    return Pieces(x[:side - 1], x[:side], in_powers(wrong, points, np.diff(x)[:side]))


def in_powers(matrix, points, width):
    """Return the powers 3 .. 0 of x - origin, from those of (x - origin)/width of Bezier points."""
    return matrix @ points / width[:, None, None] ** np.arange(3, -1, -1)[:, None]


READINGS = {SplineStress: fair, ReleasedSplineStress: released}


def build_law(weights):
    """Return the `SplineLaw` of `LawWeights`, whose one layer has the values at the knots."""
    kind, values = weights.kind, weights.layers[0][0]
    pieces = READINGS[type(kind)](knots())
    tables = np.einsum("pmk,kf->fpm", pieces.basis, kind.unit * values)
    return SplineLaw(pieces.breaks.copy(), pieces.origins.copy(), np.ascontiguousarray(tables))


@kernel
def splined(s, law):
    """Return y_i = f(s_i) + sum_j g(s_i s_j) s_j + h(J) J/s_i."""
    g01, g02 = value(law, 1, s[0] * s[1]), value(law, 1, s[0] * s[2])
    g12 = value(law, 1, s[1] * s[2])
    h = value(law, 2, s[0] * s[1] * s[2])
    return (value(law, 0, s[0]) + g01 * s[1] + g02 * s[2] + h * s[1] * s[2],
            value(law, 0, s[1]) + g01 * s[0] + g12 * s[2] + h * s[0] * s[2],
            value(law, 0, s[2]) + g02 * s[0] + g12 * s[1] + h * s[0] * s[1])


@kernel
def value(law, k, x):
    """Return f, g or h, of k = 0, 1, 2, at x."""
    p = np.searchsorted(law.breaks, x)
    c, t = law.tables[k, p], x - law.origins[p]
    return ((c[0] * t + c[1]) * t + c[2]) * t + c[3]


stretch_response.method(SplineLaw, splined)
registry.kirchhoff.method(SplineLaw, kirchhoff)
