"""Block on an incline of 24 degrees, gravity turned on a flat wall or a truly tilted plane. Way
down the plane (left), and its difference from the rigid block's (right): the start from rest,
during which the foot of the elastic block sticks, and its hopping are what is left.
"""

import matplotlib.pyplot as plt

from ..common.style import OTHERS, series, shared_scale

NEEDS = ["verification.incline"]
COLORS = dict(zip(("sliding", "thrown", "sticking", "frictionless"), OTHERS))
LABELS = {"sliding": "15 degrees, from rest", "thrown": "15 degrees, thrown",
          "sticking": "30 degrees", "frictionless": "no friction"}


def scale(results):
    return f"2D; {shared_scale(results, NEEDS[0])}"


def draw(results):
    table = results.table(NEEDS[0], "course")
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.8))
    for (plane, case), rows in series(table, ("plane", "case")).items():
        style = {"color": COLORS[case], "ls": "-" if plane == "flat" else "--"}
        t, x, exact = (table[name][rows] for name in ("t", "x", "exact"))
        left.plot(t, x, **style, label=LABELS[case] if plane == "flat" else None)
        right.plot(t, 1e3 * (x - exact), **style, label=plane if case == "sliding" else None)
    left.set(xlabel="t [s]", ylabel="way [m]")
    right.set(xlabel="t [s]", ylabel="way less that of a rigid block [mm]")
    left.legend(fontsize=8, title="friction angle", title_fontsize=8)
    for line in right.legend(fontsize=8, title="wall", title_fontsize=8).get_lines():
        line.set_color("0.3")
    figure.tight_layout()
    return figure
