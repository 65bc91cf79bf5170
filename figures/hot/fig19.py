"""HOT, Figure 19: armadillo and cat. CG iterations on the way of one step to the paper's tolerance
(dashed; left), and by step (right), with Jacobi's preconditioner and with both multigrids. CG that
allows for a preconditioner which varies is dotted.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.method_curves import EPS, STYLES
from ..common.style import legend_below, shared_scale

NEEDS = ["hot.fig19"]
METHODS = ("pn-pcg", "pn-mgpcg", "pn-mgpcg-flexible", "pn-gmg-pcg", "pn-gmg-pcg-flexible")
SCENE = "armacat_stiff"


def scale(results):
    return shared_scale(results, NEEDS[0], ".cg")


def draw(results):
    iterates, costs = (results.table(NEEDS[0], name) for name in ("iterates", "costs"))
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.4))
    for method in METHODS:
        label, color, style = STYLES[method]
        rows = iterates["method"] == method
        left.plot(iterates["residual"][rows], iterates["cg"][rows], style, color=color,
                  label=label, ms=3)
        rows = (costs["method"] == method) & (costs["scene"] == SCENE)
        right.plot(costs["step"][rows], costs["cg"][rows], style, color=color, label=label, ms=4)
    left.axvline(EPS, color="0.3", ls="--", lw=0.8)
    left.set(xscale="log", xlabel="residual", ylabel="CG iterations so far")
    left.invert_xaxis()
    right.set(xlabel="step", ylabel="CG iterations", yscale="log",
              xticks=np.unique(costs["step"][costs["scene"] == SCENE]))
    legend_below(figure, (left, right), columns=3)
    return figure
