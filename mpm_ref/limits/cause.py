"""Name the limit that a wrong cell met, of those that no run can see in itself.

    RESOLUTION      the run at 2 dx differs more from that at dx/2 than the cell does: it converges
    NO_CONVERGENCE  it does not: paths that diverge, friction that sticks or slips, pieces
    SETTING         time step, points per cell or place, which do not change the physical problem,
                    change the result
    VANISHING       the quantity hardly changes any more, so that its relative error divides by
                    almost nothing, and no other quantity is wrong

A cell whose run gave a warning has the limit of its warning too: the two are independent.
"""

from math import isfinite

RESOLUTION, NO_CONVERGENCE, SETTING = "resolution", "no convergence", "setting"
VANISHING = "vanishing quantity"
LIMITS = (RESOLUTION, NO_CONVERGENCE, SETTING, VANISHING)
LITTLE = 0.01       # of the change in the scene as given, below which a quantity may vanish


def limit_of(error, coarse_error, is_setting):
    """Return the limit that a wrong cell met, of `LIMITS` but VANISHING.

    error, coarse_error: relative differences of the cell and of its run at 2 dx from that at dx/2;
    the latter is not finite where that run did not finish, which leaves RESOLUTION. is_setting:
    whether numerical axes alone were changed, or the same cell without them is right.
    """
    if is_setting:
        return SETTING
    return NO_CONVERGENCE if isfinite(coarse_error) and coarse_error <= error else RESOLUTION


def vanishes(error, share, tolerance):
    """Return whether a quantity that is past its tolerance (relative) nearly vanishes: it changes
    by less than `LITTLE` of its change in the scene as given, its error is larger than that change,
    and yet within the tolerance of the change in the scene as given.

    error: relative to the change of the reference; share: of that change in the one as given.
    """
    return share < LITTLE and error > 1.0 and error * share <= tolerance


def limit_counts(cells):
    """Return {limit or "warning of the run": number} of wrong cells as facts, largest first.

    A cell with a warning counts as that alone.
    """
    counts = {}
    for cell in cells:
        name = "a warning of the run" if cell["warnings"] else cell["limit"]
        counts[name] = counts.get(name, 0) + 1
    return dict(sorted(counts.items(), key=lambda pair: -pair[1]))
