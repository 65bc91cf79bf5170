"""NCLaw, Table 5: mean squared errors of the laws' own answers, on all points of single frames of
water's training run. Left: P; right: F. Curves: by frame, ours by seed. Squares at the right:
gradients drawn at random from the whole run, as the text says. Dashed: what is printed, P taken to
be in Pa². Free flight ends where all curves rise.
"""

import matplotlib.pyplot as plt

from validation.common import targets

from ..common.style import legend_below, scales, series

NEEDS = ["nclaw.table5"]
STYLES = {"ours": ("ours", "C0", "-"), "ours.seed-1": ("ours, other seeds", "C0", ":"),
          "ours.seed-2": ("ours, other seeds", "C0", ":"), "labeled": ("labeled", "C1", "-")}
TERMS = {"P": "error of P [Pa²]", "Fnew": "error of F"}
BOTH = ("ours", "labeled")          # in print
WHOLE = 2500                        # where the numbers of the whole run stand, in steps


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table, printed = results.table(NEEDS[0], "frames"), targets.load()
    records = {r.target.removeprefix(f"{NEEDS[0]}."): r for r in results.records(NEEDS[0])}
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.2))
    for ax, (term, label) in zip(axes, TERMS.items(), strict=True):
        for (method,), rows in series(table, ("method",)).items():
            words, colour, dashes = STYLES[method]
            ax.loglog(table["step"][rows], table[term][rows], dashes, color=colour, label=words)
        for method in BOTH:
            record, colour = records[f"{term}.{method}"], STYLES[method][1]
            ax.plot(WHOLE, record.value, "s", color=colour, ms=6,
                    label=f"{method}, whole run")
            ax.axhline(printed[record.target].value, color=colour, ls="--", lw=1.0,
                       label=f"{method}, printed")
        ax.set(xlabel="step of the frame", ylabel=label)
    legend_below(figure, axes, columns=4)
    return figure
