"""Figure 7: the particle-grid kernel of each level of a node-embedding hierarchy."""

import numpy as np

from mpm_ref.hot.multigrid.embedding import kernel_value, width

from ..common.registry import experiment

LEVELS = (0, 1, 2, 3)
STEP = 1.0 / 64         # own cells between the points where a kernel is looked at
WORDS = {"lin": "linear", "quad": "quadratic"}


def support(kernel, level):
    """Width outside of which the kernel of a level is zero, found by looking [own cells]."""
    x = np.arange(-2.5, 2.5 + STEP, STEP)
    inside = x[kernel_value(x, kernel, level) > 0.0]
    return float(inside[-1] - inside[0] + 2.0 * STEP)


def unity(kernel, level):
    """Largest departure from 1 of the sum of all nodes' kernels at a point."""
    x = np.linspace(0.0, 1.0, 101)
    total = sum(kernel_value(x - c, kernel, level) for c in range(-3, 5))
    return float(np.max(np.abs(total - 1.0)))


@experiment("hot.fig7", title="Kernels of the levels, linear and quadratic embedding",
            budget={"quick": 1, "standard": 1, "paper": 1})
def kernels(run):
    """Widths as printed, partition of unity, and the curves."""
    for short, word in WORDS.items():
        for level in LEVELS[1:]:
            run.record(f"hot.fig7.{short}.level{level}", support(word, level),
                       scale="kernel sampled at 64 points a cell",
                       note=f"by the recursion of widths {width(word, level):g}")
        run.record(f"hot.fig7.{short}.unity", max(unity(word, level) for level in LEVELS),
                   comparator="<=", bound=1e-14, scale="levels 0 to 3",
                   note="the kernels of a level sum to one")
    run.record("hot.sec4_2.width_fine", support("linear", 0))
    run.record("hot.sec4_2.width_lin_limit", width("linear", 40), scale="level 40")
    run.record("hot.fig7.halfwidth_quad_limit", width("quadratic", 40) / 2.0, scale="level 40")
    x = np.arange(-2.0, 2.0 + STEP, STEP)
    run.table("curves", ("x", *(f"{s}{level}" for s in WORDS for level in LEVELS)),
              list(zip(x, *(kernel_value(x, w, level) for w in WORDS.values()
                            for level in LEVELS), strict=True)))
