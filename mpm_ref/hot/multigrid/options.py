"""Options of a V-cycle. The defaults are the paper's."""

from typing import NamedTuple

import numpy as np

CHOICES = {
    "smoother": ("gauss-seidel", "jacobi", "chebyshev"),
    "coarsest": ("pcg", "direct"),
    "preconditioner": ("block", "scalar"),
    "stop": ("residual", "load"),
    "precision": ("double", "single"),
}
DTYPES = {"double": np.float64, "single": np.float32}


class CycleOptions(NamedTuple):
    """Parts of a V-cycle (HOT-smoother, HOT-sec5.3-coarse)."""

    smoother: str = "gauss-seidel"
    sweeps: int = 1                   # before and after each coarse correction
    coarsest: str = "pcg"
    preconditioner: str = "block"     # of the coarsest CG: diagonal blocks or the diagonal
    tolerance: float = 0.5            # of the coarsest CG
    stop: str = "residual"            # ... relative to the restricted residual of HOT-alg2, or to
                                      # the cycle's own right-hand side restricted, as the release
    precision: str = "double"         # of the matrices that smoothers read; sums are in double


def cycle_options(levels, choices):
    """Return the `CycleOptions` of a dictionary, checked together with the number of levels.

    Raises ValueError for an unknown word or an impossible number.
    """
    unknown = sorted(set(choices) - set(CycleOptions._fields))
    if unknown:
        known = ", ".join(CycleOptions._fields)
        raise ValueError(f"hierarchy has no option {unknown[0]!r}: expected one of {known}")
    chosen = CycleOptions(**choices)
    for name, words in CHOICES.items():
        if getattr(chosen, name) not in words:
            raise ValueError(
                f"{name} = {getattr(chosen, name)!r}: expected one of {', '.join(words)}")
    if levels < 1 or chosen.sweeps < 1 or not 0.0 <= chosen.tolerance < 1.0:
        raise ValueError(
            f"levels = {levels}, sweeps = {chosen.sweeps}, tolerance = {chosen.tolerance}: "
            "expected at least one level, at least one sweep, and a tolerance in [0, 1)")
    return chosen
