"""Panels that show bodies as balls at their points, z upwards; the state figures use them."""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import Normalize, to_rgb

from .splats import Balls, image, outward
from .state_panels import composite, finish, fitted_camera, join_balls, panels, spacing

FULL, REDUCED, GHOST = "#e9e9ec", "#e8b53d", "#9aa7bd"     # the paper's white and yellow; at rest
SIZE = 0.8              # radius of a ball over the spacing
BAR, SIDE = 0.9, 0.3    # room for a colour bar and for labels at the side [inch]
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])     # of (x, z, -y)


class View(NamedTuple):
    """The direction of the camera, and the columns and width of a figure; see `Camera`."""

    columns: int
    width: float            # of all columns [inch]
    turn: float = 25.0
    lift: float = 15.0


class Panel(NamedTuple):
    """A picture: opaque balls, translucent balls, a title above and a label to the left."""

    solid: Balls
    ghost: Balls
    title: str = ""
    side: str = ""


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


def shades(values, colours="viridis", top=None):
    """Return colours (.., 3) of values from 0 to the largest or `top`, and the scale of the colour
    bar.
    """
    shown = plt.cm.ScalarMappable(Normalize(0.0, np.max(values) if top is None else top), colours)
    return shown.to_rgba(values)[..., :3], shown


def distance_to(x, origin):
    """Return distances (.., n) between points x (.., n, 3) and their origin."""
    return np.linalg.norm(x - origin, axis=-1)


def pictures(contents, view, colour_scale=None, label=""):
    """Draw `Panel`s into a figure, with a colour bar for a colour scale."""
    layers = [balls for panel in contents for balls in (panel.solid, panel.ghost)]
    camera = fitted_camera(layers, view)
    figure, axes = panels(camera, len(contents), view.columns, view.width)
    for ax, panel in zip(axes, contents, strict=True):
        ax.imshow(composite(image(panel.solid, camera), panel.ghost, camera))
        ax.set_title(panel.title, fontsize=9)
        ax.text(-0.02, 0.5, panel.side, transform=ax.transAxes, rotation=90, ha="right",
                va="center", fontsize=8)
    room = BAR * (colour_scale is not None) + SIDE * any(panel.side for panel in contents)
    figure.set_figwidth(view.width + room)
    return finish(figure, axes, colour_scale, label)
