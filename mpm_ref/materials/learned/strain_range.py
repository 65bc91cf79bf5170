"""The strains that a law has seen in training, as bounds: of each stretch, in descending order, and
of J = det F.

Bounds say where there was nothing to learn from; within them there may be gaps.
"""

import numpy as np

from .invariants import spectrum

ROUND_OFF = 1e-9        # of stretches and J, which count as within bounds


def seen(F):
    """Bounds as plain values, of deformation gradients F (.., d, d)."""
    found = measures(F.reshape(-1, *F.shape[-2:]))
    return {"low": found.min(axis=0).tolist(), "high": found.max(axis=0).tolist()}


def within(F, bounds):
    """Which (n,) of F (n, d, d) lie within bounds; none that are not finite."""
    found, slack = measures(F), ROUND_OFF
    low, high = (np.array(bounds[end]) for end in ("low", "high"))
    return np.all((found >= low - slack) & (found <= high + slack), axis=1)


def measures(F):
    """Stretches in descending order, then J, (n, d + 1), of F (n, d, d)."""
    s = spectrum(np.ascontiguousarray(F)).s
    return np.column_stack([s, s.prod(axis=1)])
