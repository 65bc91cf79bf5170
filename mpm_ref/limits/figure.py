"""Draw the margins of a scene as bars, and the maps of pairs of axes.

Matplotlib is imported when a figure is made.
"""

from math import log10

from ..store.atomic import replacing
from ..store.text import figure_text
from ..sweep.observation import CRASHED, REFUSED, STOPPED, TORN, UNSTABLE
from .answer import BUDGET_END, LAST_RUNG, counts_text, number
from .axes import UP
from .verdict import LOST, RIGHT, UNCHECKED, WRONG

COLOURS = {RIGHT: "#4c9f70", WRONG: "#c0392b", LOST: "#3b7fb5", TORN: "#b8864b",
           UNSTABLE: "#e08e2b", REFUSED: "#7a6fb0", STOPPED: "#9aa5b1", UNCHECKED: "#cfd6dd",
           CRASHED: "#222222", None: "white"}
NAMES = {WRONG: "finished and wrong", None: "not run"}      # of outcomes in the legend
SIGNS = {BUDGET_END: (" ?", "the budget ended the search"),
         LAST_RUNG: (" +", "not tried farther")}        # after the margin of a bar, by its end
COLUMNS = 5                 # of the legend
DECADES = 3.3               # shown on each side; a longer bar is cut, and its number says how far
ROW, BAR = 0.42, 0.62       # height of an axis [inch], share of it that its bar takes
WIDTH, MAP, HEAD = 7.0, 2.6, 1.1        # of the figure and of a row of maps [inch]


def save_figure(facts, out):
    """Write the figure of `answer.answer_of` to an image file, as its suffix says."""
    figure = draw_limits(facts)
    with replacing(out) as part:
        figure.savefig(part)


def draw_limits(facts):
    """Return a Matplotlib `Figure`: margins of all directions above, maps of pairs below."""
    from matplotlib.figure import Figure

    maps = [one for one in facts["maps"]
            if any(cell["outcome"] for row in one["cells"] for cell in row)]
    rows = len(axis_names(facts))
    heights = [HEAD + ROW * rows] + [MAP] * bool(maps)
    figure = Figure(figsize=(WIDTH, sum(heights)), dpi=150, layout="constrained")
    parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    draw_margins(parts[0].subplots(), facts)
    if maps:
        for axes, one in zip(parts[1].subplots(1, len(maps), squeeze=False)[0], maps, strict=True):
            draw_map(axes, one)
    explain_colours(figure, facts, maps)
    return figure


def axis_names(facts):
    """Return the names of the axes with directions, in order."""
    return list(dict.fromkeys(one["axis"] for one in facts["directions"]))


def draw_margins(axes, facts):
    """Draw a bar for each direction from 1 to its last good factor, and how it ends."""
    names = axis_names(facts)
    for one in facts["directions"]:
        draw_bar(axes, names.index(one["axis"]), one)
    axes.axvline(0.0, color="0.3", linewidth=0.8)
    ticks = range(-3, 4)
    axes.set(xlim=(-DECADES, DECADES), ylim=(len(names) - 0.5, -0.5), xticks=list(ticks),
             xticklabels=[f"{10.0**k:g}" for k in ticks], yticks=range(len(names)),
             yticklabels=[name.replace("_", " ") for name in names],
             xlabel="factor, 1 is the scene as given")
    axes.set_title(f"{figure_text(facts['title'] or facts['scene'])}: changed this far it is right",
                   fontsize=9)
    axes.grid(axis="x", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)


def draw_bar(axes, row, one):
    """Draw the bar of one direction, the first bad factor, and the margin in figures."""
    length = min(abs(log10(one["good"])), DECADES)
    sign = 1.0 if one["direction"] == UP else -1.0
    axes.barh(row, sign * length, BAR, color=COLOURS[RIGHT])
    end = length
    if one["bad"] is not None:
        end = min(abs(log10(one["bad"])), DECADES)
        axes.plot(2 * [sign * end], [row - 0.5 * BAR, row + 0.5 * BAR], linewidth=3.0,
                  color=COLOURS[one["first_bad"]["outcome"]], solid_capstyle="butt")
    text = number(one["margin"]) + SIGNS.get(one["end"], ("", ""))[0]
    if one["bad"] is not None and one["first_bad"]["limit"]:
        text += f" {one['first_bad']['limit']}"
    inside = length > 0.6 * DECADES
    place = sign * (length - 0.06) if inside else sign * (end + 0.08)
    axes.text(place, row, text, fontsize=7, va="center", color="white" if inside else "0.2",
              ha="right" if (sign > 0.0) == inside else "left")


def draw_map(axes, one):
    """Draw the verdicts on a pair of axes as coloured squares."""
    from matplotlib.colors import to_rgb

    cells = one["cells"]
    axes.imshow([[to_rgb(COLOURS[cell["outcome"]]) for cell in row] for row in cells],
                origin="lower", aspect="auto")
    for axis, factors, name in zip((axes.yaxis, axes.xaxis), one["factors"], one["axes"],
                                   strict=True):
        axis.set_ticks(range(len(factors)), [number(factor) for factor in factors], fontsize=6)
        axis.set_label_text(name.replace("_", " "), fontsize=8)
    axes.plot(one["factors"][1].index(1.0), one["factors"][0].index(1.0), "o", color="white",
              markersize=4)


def explain_colours(figure, facts, maps):
    """Add a legend of the outcomes and signs that occur, with the limits of wrong cells as its
    title.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    shown = {RIGHT} | {one["first_bad"]["outcome"] for one in facts["directions"]
                       if one["first_bad"] is not None}
    shown |= {cell["outcome"] for one in maps for row in one["cells"] for cell in row}
    patches = [Patch(facecolor=COLOURS[name], edgecolor="0.6", linewidth=0.5,
                     label=NAMES.get(name, name)) for name in COLOURS if name in shown]
    ends = {one["end"] for one in facts["directions"]}
    patches += [Line2D([], [], linestyle="", marker=f"${sign.strip()}$", color="0.2", label=words)
                for end, (sign, words) in SIGNS.items() if end in ends]
    caption = f"finished and wrong: {counts_text(facts['limits'])}" if facts["wrong"] else None
    figure.legend(handles=patches, loc="outside lower center", ncols=min(len(patches), COLUMNS),
                  fontsize=7, frameon=False, title=caption, title_fontsize=7)
