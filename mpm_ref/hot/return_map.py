"""Return maps in the potential of an implicit step, where they derive from one.

Lagged, a return map acts after the solve (HOT-sec3.1-seq): the nodes are in balance with stresses
that it then lowers. Von Mises flow on Hencky elasticity has an energy of its own
(`materials.yielding_hencky`), with which the balance is that of the stresses after the return.
"""

import numpy as np

from ..core.jit import kernel
from ..core.state import NO_HISTORY
from ..materials import Hardening, Hencky, NoFlow, Softening, VonMises
from ..materials.yielding_hencky import YieldingHencky


@kernel
def law_of(law, tau_y, p):
    """The law of point p of a body: with its yield stress, where the points have one."""
    if tau_y.ndim == 1:
        return YieldingHencky(law.mu, law.lam, tau_y[p])
    else:
        return law


def yield_stresses(body, order):
    """Return the yield stress of each particle (N,) [Pa] of a body's von Mises flow, in an order
    (N,), or no array without a flow.
    """
    if isinstance(body.flow, NoFlow):
        return NO_HISTORY
    y = body.particles.y
    return y[order] if y.ndim == 1 else np.full(len(order), body.flow.tau_y)


def check_return_map(body, return_map):
    """Raise ValueError for a body whose flow has no potential, if return_map is "implicit"."""
    if return_map == "lagged" or isinstance(body.flow, NoFlow):
        return
    von_mises = VonMises | Hardening | Softening
    if not (isinstance(body.law, Hencky) and isinstance(body.flow, von_mises)):
        raise ValueError(f"body {body.name!r}: {type(body.flow).__name__} on "
                         f"{type(body.law).__name__} with return_map = 'implicit': expected von "
                         "Mises flow on 'hencky', which has a potential, or return_map = 'lagged'")
    if body.flow.s_min > 0.0:
        raise ValueError(f"body {body.name!r}: s_min = {body.flow.s_min} with return_map = "
                         "'implicit', whose potential lifts no stretches: expected s_min = 0, or "
                         "return_map = 'lagged'")
