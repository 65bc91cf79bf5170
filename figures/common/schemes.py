"""Labels and markers of LDM's four schemes, and curves of errors by scheme."""

import matplotlib.pyplot as plt

from .style import legend_below, series

MARKS = {"lagrangian_nonlinear": ("Lagrangian, nonlinear", "o"),
         "lagrangian_linear": ("Lagrangian, linear", "s"),
         "eulerian_nonlinear": ("Eulerian, nonlinear", "^"),
         "eulerian_linear": ("Eulerian, linear", "v"), "pod": ("POD, Lagrangian, linear", "x")}


def curves(table, column, label, line="", more=()):
    """Draw position errors [%] over a column of a table of errors, by scheme. `line` joins the
    points, `more` holds further (scheme, label, style).
    """
    figure, ax = plt.subplots(figsize=(6.4, 4.0))
    masks = series(table, ("scheme",))
    styles = [(name, words, mark + line) for name, (words, mark) in MARKS.items()]
    for name, words, style in (*styles, *more):
        if (name,) in masks:
            rows = masks[name,]
            ax.semilogy(table[column][rows], 100.0 * table["origin"][rows], style, label=words,
                        fillstyle="none")
    ax.set(xlabel=label, ylabel="position error [%]")
    legend_below(figure, [ax], columns=3)
    return figure
