"""A free spinning body. Left: angular momentum, the spin of the affine field included; APIC and MLS
keep it to round-off, PIC (the negative control) loses it. Right: mechanical energy.
"""

import matplotlib.pyplot as plt

from ..common.style import TRANSFERS, series, shared_scale

NEEDS = ["verification.rotation"]


def scale(results):
    table = results.table(NEEDS[0], "history")
    turns = {body: max(table["turns"][rows]) for (body,), rows in series(table, ("body",)).items()}
    words = ", ".join(f"{body} over {n:.3g} revolutions" for body, n in turns.items())
    return f"{words}; dx = {shared_scale(results, NEEDS[0]).split('dx = ')[-1]}"


def draw(results):
    table = results.table(NEEDS[0], "history")
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.6), sharex=True)
    for (body, transfer), rows in series(table, ("body", "transfer")).items():
        style = {"color": TRANSFERS[transfer], "ls": "-" if body == "disk" else ":",
                 "lw": 3.0 if transfer == "mls" else 1.4}      # APIC lies upon MLS
        for ax, what in ((left, "L"), (right, "energy")):
            ax.plot(table["turns"][rows], table[what][rows], **style, label=f"{body}, {transfer}")
    left.set(xlabel="revolutions", ylabel="angular momentum / its start", ylim=(-0.05, 1.1))
    right.set(xlabel="revolutions", ylabel="energy / its start", ylim=(-0.05, 1.1))
    left.legend(fontsize=8)
    figure.tight_layout()
    return figure
