"""Fill a solid with points, each of which represents a volume.

The records are the samplings of scene files; `sample` carries one out. docs/reference/scenes.md
compares them.
"""

from functools import singledispatch
from typing import Annotated, Literal, NamedTuple

import numpy as np
from msgspec import Meta

from ..shapes.inside import check_bounded
from ..shapes.quantities import Count, Kind, Length, PerCell, Seed, Share
from .poisson import poisson_disk

MOST_POINTS = 50_000_000        # candidates that a lattice may have
FILL = 0.87                     # of per_cell^d points per cell (LDM-tab2-sampling)
PACKING = {2: 0.62, 3: 0.59}    # N r^d / volume of `poisson_disk` in a large box: a first guess
SURPLUS = 0.01                  # of the points that may be left out to hit a number exactly
TRIALS = 12                     # of radii, per number of points asked for


class Points(NamedTuple):
    """Sampled points and their volumes at rest."""

    x: np.ndarray       # (N, d) position [m]
    V0: np.ndarray      # (N,)   volume [m^d]


class Regular(Kind, tag="regular"):
    """A sampling with per_cell^d points in every grid cell, at the centres of equal sub-cells."""

    per_cell: PerCell = 2
    volume: Literal["shape", "cell"] = "shape"


class Jittered(Kind, tag="jittered"):
    """A random sampling with each point in the middle `amplitude` share of a `Regular` sub-cell."""

    per_cell: PerCell = 2
    amplitude: Share = 1.0
    seed: Seed | None = None
    volume: Literal["shape", "cell"] = "shape"


class Lattice(Kind, tag="lattice"):
    """A lattice fixed to the shape's box: `counts` points per axis, or points `spacing` [m] apart.

    With `faces` the outermost of `counts` points lie on the faces of the box, as in numpy.linspace;
    otherwise half a step inside.
    """

    counts: tuple[Count, ...] | None = None
    spacing: Length | None = None
    faces: bool = False
    volume: Literal["shape", "cell"] = "shape"

    def __post_init__(self):
        if (self.counts is None) == (self.spacing is None):
            raise ValueError("a lattice needs `counts` or `spacing`, one of the two")
        if self.faces and (self.counts is None or min(self.counts) < 2):
            raise ValueError("`faces` needs `counts` of at least 2 along every axis")


class Poisson(Kind, tag="poisson"):
    """A Poisson-disk sampling: random points with a minimal distance.

    Give the distance, `radius` [m], or the number of points: `count`, or `fill` of per_cell^d per
    cell.
    """

    radius: Length | None = None
    count: Count | None = None
    per_cell: PerCell | None = None
    fill: Annotated[float, Meta(gt=0, le=10)] = FILL
    seed: Seed | None = None

    def __post_init__(self):
        if [self.radius, self.count, self.per_cell].count(None) != 2:
            raise ValueError("poisson needs `radius`, `count` or `per_cell`, one of the three")


Samplings = Regular | Jittered | Lattice | Poisson


def sample(sampling, solid, dx, seed):
    """Return the `Points` of a solid (with inside(x), low, high, volume) for a grid spacing dx [m].

    seed: any seed of NumPy's default generator, for records without one. The volumes are equal and
    sum to the solid's; with volume = "cell" they are dx^d / per_cell^d, or that of the lattice's
    cell. Raises ValueError if no point is inside.
    """
    check_bounded(solid)
    record_seed = getattr(sampling, "seed", None)
    x = points(sampling, solid, dx, seed if record_seed is None else record_seed)
    if len(x) == 0:
        raise ValueError(f"no sample point is inside the shape, whose box is {_text(solid)}; "
                         "take a finer sampling")
    V0 = solid.volume / len(x)
    if getattr(sampling, "volume", "shape") == "cell":
        V0 = cell_volume(sampling, solid, dx)
    return Points(x, np.full(len(x), V0))


@singledispatch
def points(sampling, solid, dx, seed):
    """Return the points (N, d) of a sampling record inside a solid."""
    raise TypeError(f"{type(sampling).__name__} is not a sampling")


@points.register
def _(sampling: Regular, solid, dx, seed):
    return inside(solid, _centres(solid, dx, sampling.per_cell))


@points.register
def _(sampling: Jittered, solid, dx, seed):
    x = _centres(solid, dx, sampling.per_cell)
    jitter = np.random.default_rng(seed).uniform(-0.5, 0.5, x.shape)
    return inside(solid, x + jitter * (sampling.amplitude * dx / sampling.per_cell))


@points.register
def _(sampling: Lattice, solid, dx, seed):
    middle, half = 0.5 * (solid.low + solid.high), 0.5 * (solid.high - solid.low)
    counts, steps = _lattice(sampling, solid)
    _check_number(counts)
    axes = [m + _steps(n, h, step, sampling.faces)
            for m, h, n, step in zip(middle, half, counts, steps)]
    return inside(solid, _grid(axes))


@points.register
def _(sampling: Poisson, solid, dx, seed):
    if sampling.radius is not None:
        return poisson_points(solid, sampling.radius, seed)
    count = sampling.count
    if count is None:
        count = round(sampling.fill * solid.volume * (sampling.per_cell / dx) ** len(solid.low))
    if count < 1:
        raise ValueError(f"fill = {sampling.fill:g} asks for less than one point in the shape; "
                         "take a larger per_cell")
    return poisson_count(solid, count, seed)


def inside(solid, x):
    """Return the points of x (N, d) that lie inside the solid."""
    return np.ascontiguousarray(x[solid.inside(x)])


def poisson_points(solid, r, seed):
    """Return the Poisson-disk points of the solid's box that lie inside the solid."""
    return inside(solid, poisson_disk(solid.low, solid.high, r, np.random.default_rng(seed)))


def poisson_count(solid, count, seed):
    """Return `count` Poisson-disk points of a solid, such as the 1368 of LDM-sec5.1.

    The number of points falls with the radius, but not monotonically, so that few radii give an
    exact number: a radius with a few more points is chosen, and some points are dropped at random.
    Raises ValueError if no radius gives enough points.
    """
    d, best, n = len(solid.low), None, 0
    aim = count * (1.0 + 0.5 * SURPLUS)
    r = (PACKING[d] * solid.volume / aim) ** (1.0 / d)
    for _ in range(TRIALS):
        x = poisson_points(solid, r, seed)
        n = len(x)
        if n >= count and (best is None or n < len(best)):
            best = x
        if count <= n <= count * (1.0 + SURPLUS):
            break
        r *= min(max((max(n, 1) / aim) ** (1.0 / d), 0.5), 2.0)
    if best is None:
        raise ValueError(f"count = {count}: no radius gave that many points, the last gave {n}; "
                         "give `radius`")
    keep = np.random.default_rng([count, len(best)]).permutation(len(best))[:count]
    return best[np.sort(keep)]


def cell_volume(sampling, solid, dx):
    """Return the volume of a lattice's cell [m^d]."""
    if isinstance(sampling, Lattice):
        return float(np.prod(_lattice(sampling, solid)[1]))
    return float((dx / sampling.per_cell) ** len(solid.low))


def _lattice(sampling, solid):
    """Return the number of points per axis, and their distance along it [m]."""
    size = solid.high - solid.low
    if sampling.counts is None:
        counts = np.maximum(np.floor(size / sampling.spacing * (1.0 + 1e-12)), 1)
        return counts, np.full(len(size), sampling.spacing)
    if len(sampling.counts) != len(size):
        raise ValueError(f"counts = {list(sampling.counts)}: expected {len(size)} numbers")
    counts = np.array(sampling.counts, dtype=float)
    return counts, size / (counts - sampling.faces)


def _steps(n, half, step, faces):
    """Return n coordinates about 0, `step` apart; with `faces` exactly from -half to half."""
    if faces:
        return np.linspace(-half, half, int(n))
    return (np.arange(n) - 0.5 * (n - 1)) * step


def _centres(solid, dx, k):
    """Return the centres of the sub-cells of edge dx/k, aligned to the grid, that meet the box."""
    h = dx / k
    first, last = np.floor(solid.low / h), np.ceil(solid.high / h)
    _check_number(last - first)
    return _grid([(np.arange(a, b) + 0.5) * h for a, b in zip(first, last)])


def _check_number(counts):
    most = np.prod(np.maximum(counts, 1.0))
    if not most <= MOST_POINTS:
        raise ValueError(f"{most:.1e} lattice points in the shape's box, the limit is "
                         f"{MOST_POINTS:.0e}; take a coarser sampling")


def _grid(axes):
    """Return all combinations (N, d) of coordinates, the last axis fastest."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _text(solid):
    corners = [", ".join(f"{c:.6g}" for c in corner) for corner in (solid.low, solid.high)]
    return f"({corners[0]}) to ({corners[1]})"
