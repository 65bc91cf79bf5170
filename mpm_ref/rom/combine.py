"""Sums of modes at chosen points, without a copy of their modes: most of what inference costs is to
read them once.
"""

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange


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
