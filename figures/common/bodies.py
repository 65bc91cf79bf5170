"""Panels that show bodies as balls at their points, z upwards; the state figures use them."""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm, Normalize, to_rgb

from .splats import Balls, image, outward
from .state_panels import (
    WIDTH,
    composite,
    finish,
    fitted_camera,
    join_balls,
    open_above,
    panels,
    spacing,
)

FULL, REDUCED, GHOST = "#e9e9ec", "#e8b53d", "#9aa7bd"     # the paper's white and yellow; at rest
SIZE = 0.8              # radius of a ball over the spacing
ROOM = 0.15             # margin around what a picture is to show, over its longest side
FAILED = "#9c2b23"      # of what is written about a run that failed
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])     # of (x, z, -y)


class View(NamedTuple):
    """The direction of the camera, and the columns and width of a figure; see `Camera`."""

    columns: int
    turn: float = 25.0
    lift: float = 15.0
    width: float = WIDTH    # [inch]


class Panel(NamedTuple):
    """A picture: opaque balls, translucent balls, a title above, a label to the left and a note
    below, which says what failed.
    """

    solid: Balls
    ghost: Balls
    title: str = ""
    side: str = ""
    note: str = ""


def body(x, colour, spacing_at_rest, size=SIZE):
    """Return balls at points x (n, 3), z upwards, sized by their spacing at rest [m]. The colour is
    one for all, or (n, 3).
    """
    x = np.asarray(x, dtype=float) @ UPRIGHT.T
    rgb = np.array(to_rgb(colour)) if isinstance(colour, str) else colour
    return Balls(x, outward(x), np.full(len(x), size * spacing_at_rest),
                 np.broadcast_to(rgb, (len(x), 3)))


def ghost(X):
    """Return the balls of a body at rest, drawn as a translucent layer."""
    return body(X, GHOST, spacing(X))


def no_balls():
    """Return an empty set of balls."""
    return Balls(*(np.zeros(shape) for shape in ((0, 3), (0, 3), (0,), (0, 3))))


def side_by_side(left, right, view):
    """Return the balls of two bodies, the second shifted to the right of the first."""
    along = fitted_camera([left], view).axes[0]
    gap = 1.1 * np.ptp(np.concatenate([left.x, right.x]) @ along)
    return join_balls([left, right._replace(x=right.x + gap * along)])


def flattened(balls, view):
    """Return balls pressed nearly into one plane, so that none is dark for lying behind others."""
    eye = fitted_camera([balls], view).axes[2]
    return balls._replace(x=balls.x - 0.999 * np.outer(balls.x @ eye, eye), n=0.0 * balls.n)


def shades(values, colours="viridis", top=None, bottom=0.0):
    """Return colours (.., 3) of values from `bottom` to the largest or `top`, and the scale of the
    colour bar. They are logarithmic where the bottom is not 0.
    """
    ends = bottom, np.max(values) if top is None else top
    shown = plt.cm.ScalarMappable(LogNorm(*ends, clip=True) if bottom else Normalize(*ends),
                                  colours if top is None else open_above(colours))
    return shown.to_rgba(values)[..., :3], shown


def distance_to(x, origin):
    """Return distances (.., n) between points x (.., n, 3) and their origin."""
    return np.linalg.norm(x - origin, axis=-1)


def padded_box(x, room=ROOM):
    """Return the corners (2, d) of the box of points x (n, d) with a margin around it."""
    low, high = x.min(axis=0), x.max(axis=0)
    spare = room * (high - low).max()
    return np.array([low - spare, high + spare])


def inside(x, box):
    """Return which points x (n, d) are finite and within the corners (2, d) of a box."""
    return ((x >= box[0]) & (x <= box[1])).all(axis=1)


def failure_note(x, shown):
    """Return a note on points x (n, 3) that a picture leaves out, "" where there are none; shown
    (n,): those that it has.
    """
    if not np.isfinite(x).all():
        return "broke down"
    return "" if shown.all() else f"{100.0 * (1.0 - shown.mean()):.2g} % outside"


def pictures(contents, view, colour_scale=None, label=""):
    """Draw `Panel`s into a figure, with a colour bar for a colour scale."""
    layers = [balls for panel in contents for balls in (panel.solid, panel.ghost)]
    camera = fitted_camera(layers, view)
    figure, axes = panels(camera, len(contents), view.columns, view.width)
    for ax, panel in zip(axes, contents, strict=True):
        ax.imshow(composite(image(panel.solid, camera), panel.ghost, camera))
        ax.set_title(panel.title)
        ax.text(-0.02, 0.5, panel.side, transform=ax.transAxes, rotation=90, ha="right",
                va="center", ma="center", fontsize=9)
        at, aligned = (0.0, "top") if len(panel.solid.x) else (0.5, "center")
        ax.text(0.5, at, panel.note, transform=ax.transAxes, ha="center", va=aligned, fontsize=8,
                color=FAILED)
    return finish(figure, axes, colour_scale, label)
