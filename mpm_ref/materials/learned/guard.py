"""Strains that a deployed law is evaluated at, cut to a box around those of its training.

A network answers at any F, and far from its training the answer is a guess: one inverted particle
can get a stress that destroys a whole run. With bounds, of F = U diag(s) V^T a law reads

    F_cut = U diag(c) V^T,    c_a = min(max(s_a, low_a), high_a)

and where det F_cut is outside of its own bounds, c is scaled by a common factor, each c_a within
its bounds, to the nearer one. Stress and energy are those of F_cut. A return map
reads F_cut too, and leaves half of what was cut:

    tau = kirchhoff(F_cut),    returned(F) = returned(F_cut) + (F - F_cut)/2

so that a point in the spray, which strains more and more, does not stretch without end; and a point
that was cut stays out of the box for a step, where it can be counted. Within the box nothing
changes, to the bit; without bounds no F is cut.
"""

from math import exp, log
from typing import NamedTuple

import numpy as np

from ...core.jit import borrowing, kernel
from ...core.spectral import svd
from ...core.tensor import mlin, mmt, scale_columns
from .strain_range import strain_measures

MARGIN = 0.3            # widths of the range of training that the box adds on either side
LEAST_SHARE = 0.5       # a bound > 0 of training stays above this share of itself
HALVINGS = 60           # of the interval of log f
NONE = np.empty(0)      # bounds of a law that cuts nothing


class StrainBox(NamedTuple):
    """Bounds of the stretches s_0 >= s_1 >= .. and of J; d + 1 numbers each."""

    low: np.ndarray
    high: np.ndarray


def strain_box(bounds, margin=MARGIN):
    """Return the `StrainBox` a margin around the bounds of a training (see `strain_range`).

    A lower bound > 0 stays > 0, so that a law that met no inverted point is asked about none.
    """
    low, high = (np.array(bounds[end], dtype=float) for end in ("low", "high"))
    width = margin * (high - low)
    widened = low - width
    return StrainBox(np.where(low > 0.0, np.maximum(widened, LEAST_SHARE * low), widened),
                     high + width)


def guarded(law, box):
    """Return a learned law or flow whose strains are cut to a `StrainBox`; others as they are."""
    return law._replace(low=box.low, high=box.high) if is_guardable(law) else law


def is_guardable(law):
    """Return whether strains of a law or flow can be cut: that of a network of F is."""
    return {"low", "high"} <= set(getattr(law, "_fields", ()))


def is_guarded(law):
    """Return whether strains of a law or flow are cut."""
    return is_guardable(law) and len(law.low) > 0


def count_cut(F, box):
    """Return the number of points whose strains are cut, of F (n, d, d); those that are not finite
    count.
    """
    with np.errstate(invalid="ignore"):
        measures = strain_measures(F)
        inside = (measures >= box.low) & (measures <= box.high)
    return int(len(F) - np.sum(inside.all(axis=1)))


@kernel
def cut(F, low, high):
    """Return F_cut and whether it differs from F; bounds of no entries cut nothing."""
    if len(low) == 0:
        return F, False
    U, s, V, _ = svd(F)
    c = cut_stretches(s, low, high)
    if same(c, s):
        return F, False
    return mmt(scale_columns(U, c), V), True


@borrowing
def cut_factors(F, low, high):
    """Return what `cut` does, and in between U, s, V of the `svd` of F_cut."""
    U, s, V, _ = svd(F)
    if len(low) == 0:
        return F, (U, s, V), False
    c = cut_stretches(s, low, high)
    if same(c, s):
        return F, (U, s, V), False
    F_cut = mmt(scale_columns(U, c), V)
    U, s, V, _ = svd(F_cut)
    return F_cut, (U, s, V), True


@kernel
def cut_stretches(s, low, high):
    """Return the stretches of F_cut."""
    c, d = clamped(1.0, s, low, high), len(s)
    J = product(c)
    if J < low[d] and c[d - 1] > 0.0:
        return scaled_to(low[d], 1.0, c, low, high)
    elif J > high[d]:
        return scaled_to(high[d], -1.0, c, low, high)
    else:
        return c


@kernel
def scaled_to(J, sign, c, low, high):
    """Return f c within the box, whose product is J, with log f of this sign."""
    near, far, end = 0.0, 0.0, high if sign > 0.0 else low
    for a in range(len(c)):
        if c[a] > 0.0 and end[a] > 0.0:
            far = max(far, abs(log(end[a] / c[a])))
    for _ in range(HALVINGS):
        middle = 0.5 * (near + far)
        if sign * (product(clamped(exp(sign * middle), c, low, high)) - J) < 0.0:
            near = middle
        else:
            far = middle
    return clamped(exp(sign * far), c, low, high)


@kernel
def clamped(f, s, low, high):
    """Return f s, each between its bounds; NaN stays."""
    if len(s) == 2:
        return clamp(f * s[0], low[0], high[0]), clamp(f * s[1], low[1], high[1])
    else:
        return (clamp(f * s[0], low[0], high[0]), clamp(f * s[1], low[1], high[1]),
                clamp(f * s[2], low[2], high[2]))


@kernel
def clamp(a, low, high):
    """Return a between two bounds; NaN stays."""
    if a < low:
        return low
    return high if a > high else a


@kernel
def product(s):
    """Return the product of the entries."""
    J = 1.0
    for s_a in s:
        J *= s_a
    return J


@kernel
def same(a, b):
    """Return whether two vectors have equal entries; NaN equals NaN."""
    for i in range(len(a)):
        if a[i] != b[i] and (a[i] == a[i] or b[i] == b[i]):
            return False
    return True


@kernel
def with_half_the_rest(F, F_cut, F_new):
    """Return F_new + (F - F_cut)/2."""
    return mlin(1.0, F_new, 0.5, mlin(1.0, F, -1.0, F_cut))
