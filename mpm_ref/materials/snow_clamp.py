"""Snow: singular values are clamped, in HOT-material to [0.99, 1.001], without hardening.

Stress enters no yield condition here: for large lam / mu a step may even raise the energy, when a
clamped shear leaves a change of volume behind. With lam = 0 it never does.
"""

from math import isfinite
from typing import NamedTuple

from ..core.jit import kernel
from .log_strain import clamp
from .log_strain_adjoint import clamp_gap_ratio, clamp_vjp
from .no_flow import never_fails


class SnowClamp(NamedTuple):
    """Bounds of the elastic singular values."""

    s_min: float    # 1 - critical compression
    s_max: float    # 1 + critical stretch


def build(s_min, s_max):
    """Return the clamp; ValueError unless 0 < s_min <= 1 <= s_max, finite."""
    if not (0.0 < s_min <= 1.0 <= s_max and isfinite(s_max)):
        raise ValueError(f"s_min = {s_min}, s_max = {s_max}: expected 0 < s_min <= 1 <= s_max")
    return SnowClamp(float(s_min), float(s_max))


@kernel
def project(s, y, dt, law, flow):
    """Return the clamped singular values, y as it is."""
    return clamp(s, flow.s_min, flow.s_max), y


@kernel
def project_vjp(state, bars, dt, law, flow):
    """Return the bars before the clamp; those of mu, lam, s_min, s_max; a 1 for the share, not
    read.
    """
    s_bar, low_bar, high_bar = clamp_vjp(state[0], bars[0], flow.s_min, flow.s_max)
    return (s_bar, bars[1]), (0.0, 0.0, low_bar, high_bar), 1.0


@kernel
def gap_ratio(s, s_new, i, j, share, flow):
    """Return (s'_i - s'_j)/(s_i - s_j)."""
    return clamp_gap_ratio(s, i, j, flow.s_min, flow.s_max)


intact = never_fails
