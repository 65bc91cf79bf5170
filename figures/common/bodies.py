"""What LDM's state figures share: panels of the points of bodies, z upwards."""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import Normalize, to_rgb

from .splats import Balls, image, outward
from .state_panels import framed, joined, panels, settled, shone, spacing

FULL, REDUCED, GHOST = "#e9e9ec", "#e8b53d", "#9aa7bd"     # the paper's white and yellow; at rest
SIZE = 0.8              # radius of a ball over the spacing
BAR, SIDE = 0.9, 0.3    # room for a colour bar and for words at the side [inch]
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])     # of (x, z, -y)


class View(NamedTuple):
    """From where bodies are seen, and in how many columns; see `Camera`."""

    columns: int
    width: float            # of all columns [inch]
    turn: float = 25.0
    lift: float = 15.0


class Panel(NamedTuple):
    """A picture: balls, balls that shine through, words above and to the left."""

    solid: Balls
    ghost: Balls
    title: str = ""
    side: str = ""


def body(x, colour, apart, size=SIZE):
    """Balls of points x (n, 3), z upwards, that are so far apart at rest [m]; of one colour, or
    colours (n, 3).
    """
    x = np.asarray(x, dtype=float) @ UPRIGHT.T
    rgb = np.array(to_rgb(colour)) if isinstance(colour, str) else colour
    return Balls(x, outward(x), np.full(len(x), size * apart),
                 np.broadcast_to(rgb, (len(x), 3)))


def ghost(X):
    """Balls of a body at rest, to shine through."""
    return body(X, GHOST, spacing(X))


def nothing():
    """No balls."""
    return Balls(*(np.zeros(shape) for shape in ((0, 3), (0, 3), (0,), (0, 3))))


def side_by_side(left, right, view):
    """Balls of two bodies, the second moved to the right of the first."""
    along = framed([left], view).axes[0]
    gap = 1.1 * np.ptp(np.concatenate([left.x, right.x]) @ along)
    return joined([left, right._replace(x=right.x + gap * along)])


def levelled(balls, view):
    """Balls on their own nearly in one plane, so that none is dark for lying behind others."""
    eye = framed([balls], view).axes[2]
    return balls._replace(x=balls.x - 0.999 * np.outer(balls.x @ eye, eye), n=0.0 * balls.n)


def shades(values, colours="viridis", top=None):
    """(colours (.., 3) of values, what a colour bar shows), from 0 to the largest or `top`."""
    shown = plt.cm.ScalarMappable(Normalize(0.0, np.max(values) if top is None else top), colours)
    return shown.to_rgba(values)[..., :3], shown


def away(x, origin):
    """Distances (.., n) of points x (.., n, 3) from others."""
    return np.linalg.norm(x - origin, axis=-1)


def pictures(found, view, shown=None, words=""):
    """The figure of some `Panel`s, with a colour bar for what is shown."""
    layers = [balls for panel in found for balls in (panel.solid, panel.ghost)]
    camera = framed(layers, view)
    figure, axes = panels(camera, len(found), view.columns, view.width)
    for ax, panel in zip(axes, found, strict=True):
        ax.imshow(shone(image(panel.solid, camera), panel.ghost, camera))
        ax.set_title(panel.title, fontsize=9)
        ax.text(-0.02, 0.5, panel.side, transform=ax.transAxes, rotation=90, ha="right",
                va="center", fontsize=8)
    room = BAR * (shown is not None) + SIDE * any(panel.side for panel in found)
    figure.set_figwidth(view.width + room)
    return settled(figure, axes, shown, words)
