"""Colliding rings: mechanical energy with each transfer. Crosses: what a public code's tests hold
for the end, from randomly placed particles on the grid of the standard profile.
"""

import matplotlib.pyplot as plt

from ..common.style import TRANSFERS, series, shared_scale

NEEDS = ["verification.rings"]


def scale(results):
    return f"2D; {shared_scale(results, NEEDS[0])}"


def draw(results):
    table = results.table(NEEDS[0], "energy")
    records = {r.target.split(".")[2]: r for r in results.records(NEEDS[0]) if r.unit == "J/m"}
    figure, ax = plt.subplots(figsize=(6.0, 3.8))
    for (transfer,), rows in series(table, ("transfer",)).items():
        total = table["kinetic"][rows] + table["elastic"][rows]
        ax.plot(table["t"][rows], total, color=TRANSFERS[transfer], label=transfer)
        record = records[transfer]
        if record.paper is not None:
            ax.plot(table["t"][rows][-1], total[-1] * record.paper / record.value, "x",
                    color=TRANSFERS[transfer], clip_on=False)
    ax.set(xlabel="t [s]", ylabel="energy / its start", ylim=(0.0, 1.1))
    ax.legend(fontsize=8)
    return figure
