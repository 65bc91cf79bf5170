"""Pictures of results: particles coloured by a field, as a figure or as an animation.

3D bodies are seen from the front: gravity points down, the axis that is neither it nor horizontal
is looked along, nearer particles drawn last. Colliders, walls and prescribed regions of the scene
are shaded where they are solid, in 3D as the slice through the middle of the particles' depth.
Matplotlib is imported when a picture is made.
"""

from typing import NamedTuple

import numpy as np

from .core.levelset import distances
from .scene import SceneError, loads
from .scene.builder import build_conditions
from .store.atomic import replacing
from .store.results import SCALARS, BadResults

AXES = "xyz"
LABELS = {"tau": "|tau|_F"}
POINT = 72.0                  # points per inch, in which marker sizes are given
WIDTH, HEIGHTS = 4.6, (1.5, 8.0)      # of the axes [inch]
ROOM = 1.9, 0.8               # for the colour bar and for labels and title [inch]
SAMPLES = 400                 # of a level set along the longer side of a picture
FAR = 1e300                   # a distance [m]
SHADE, EDGE = "0.88", "0.35"


class Window(NamedTuple):
    """The region of a picture: its (horizontal, vertical) axes and the ends of every axis [m]."""

    view: tuple
    ends: np.ndarray          # (d, 2)
    dx: float                 # of the grid [m]

    @property
    def box(self):
        """Ends of the horizontal and of the vertical axis [m]."""
        return self.ends[list(self.view)]

    @property
    def sides(self):
        """Width and height [m]."""
        return np.diff(self.box)[:, 0]

    @property
    def inches(self):
        """Inches per metre."""
        return min(WIDTH / self.sides[0], HEIGHTS[1] / self.sides[1])


def view_of(results):
    """Return (horizontal, vertical) axes, as numbers: up is against gravity, or y without
    gravity.
    """
    g = results.gravity
    up = int(np.argmax(np.abs(g))) if np.any(g) else 1
    return (1 if up == 0 else 0), up


def draw(results, frame=-1, field="speed", view=None):
    """Return a Matplotlib `Figure` of the particles of one frame; `field` is one of
    `results.SCALARS`, view the (horizontal, vertical) axes. Raises `BadResults`.
    """
    frame = results.index(frame)
    return _drawing(results, frame, field, _window(results, [frame], view))


def save_plot(results, out, **what):
    """Write `draw(results, **what)` to an image file, png, pdf or svg as its suffix says."""
    figure = draw(results, **what)
    with replacing(out) as part:
        figure.savefig(part)


def animate(results, out, field="speed", view=None, fps=20):
    """Write a GIF of all frames, on fixed axes and one colour scale. Raises `BadResults`."""
    from matplotlib.animation import FuncAnimation, PillowWriter

    frames = range(len(results))
    window = _window(results, frames, view)
    figure = _drawing(results, results.index(0), field, window)
    axes, conditions = figure.axes[0], _conditions(results)
    points = particles(axes)
    solids = [drawn for drawn in axes.collections if drawn is not points]
    if field != "body":
        points.set_clim(*_range(_values(results, k, field) for k in frames))

    def show(k):
        x, values, sizes = _dots(results, k, field, window)
        points.set(offsets=x, array=values, sizes=sizes)
        axes.set_title(_title(results, k), fontsize=9)
        if conditions is not None and conditions.moves:
            while solids:
                solids.pop().remove()
            solids.extend(_draw_solids(axes, conditions, window, results.time[k]))
        return [points]

    film = FuncAnimation(figure, show, frames)
    with replacing(out) as part:
        film.save(part, writer=PillowWriter(fps=fps), dpi=80)


def particles(axes):
    """Return the artists of particles on axes."""
    return next(a for a in axes.collections if a.get_gid() == "particles")


# What is drawn of the particles

def _title(results, frame):
    return f"{results.title or results.path.name}, t = {results.time[frame]:.4g} s"


def _positions(results, frame):
    return np.concatenate([results.field(body, "x", frame) for body in results.bodies])


def _values(results, frame, field):
    return np.concatenate([results.scalar(body, field, frame) for body in results.bodies])


def _order(results, frame, view):
    """Return particles from far to near."""
    x = _positions(results, frame)
    depth = [a for a in range(results.dim) if a not in view]
    return np.argsort(-x[:, depth[0]], kind="stable") if depth else np.arange(len(x))


def _range(arrays):
    """Return the smallest and largest finite value."""
    finite = [a[np.isfinite(a)] for a in arrays]
    ends = [(a.min(), a.max()) for a in finite if len(a)] or [(0.0, 1.0)]
    return min(low for low, _ in ends), max(high for _, high in ends)


def _window(results, frames, view):
    """Return the `Window` around the particles of frames, with a margin."""
    view = view or view_of(results)
    if max(view) >= results.dim:
        raise BadResults(f"{results.path}: there is no axis {AXES[max(view)]} in {results.dim}D")
    x = [_positions(results, k) for k in frames]
    ends = np.array([_range(a[:, axis] for a in x) for axis in range(results.dim)])
    spare = max(2.0 * results.dx, 0.08 * np.diff(ends).max())
    return Window(tuple(view), ends + (-spare, spare), results.dx)


def _drawing(results, frame, field, window):
    """Return the figure of a frame."""
    from matplotlib.figure import Figure

    width, height = window.sides * window.inches
    size = width + ROOM[0], np.clip(height, *HEIGHTS) + ROOM[1]
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    axes = figure.add_subplot()
    horizontal, vertical = (f"{AXES[a]} [m]" for a in window.view)
    axes.set(xlim=window.box[0], ylim=window.box[1], aspect="equal", xlabel=horizontal,
             ylabel=vertical)
    axes.set_title(_title(results, frame), fontsize=9)
    _draw_solids(axes, _conditions(results), window, results.time[frame])
    x, values, sizes = _dots(results, frame, field, window)
    points = axes.scatter(*x.T, c=values, s=sizes, linewidths=0, zorder=2, gid="particles")
    _explain_colours(figure, points, field, results.bodies)
    return figure


def _explain_colours(figure, points, field, bodies):
    """Add a legend of the bodies, or a colour bar with the field and its unit."""
    if field == "body":
        _name_bodies(points, bodies)
    else:
        unit, label = SCALARS[field][0], LABELS.get(field, field)
        figure.colorbar(points, ax=figure.axes, label=f"{label} [{unit}]" if unit != "1" else label)


def _name_bodies(points, bodies):
    """Draw each body in one of ten colours, with a legend beside the axes."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap
    from matplotlib.lines import Line2D

    colours = [colormaps["tab10"](k % 10) for k in range(len(bodies))]
    points.set(cmap=ListedColormap(colours), clim=(-0.5, len(bodies) - 0.5))
    marks = [Line2D([], [], marker="o", ls="", color=colour) for colour in colours]
    points.axes.legend(marks, bodies, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8,
                       frameon=False)


def _dots(results, frame, field, window):
    """Return the places, values and sizes of the particles that are there, from far to near; as
    wide as they lie apart.
    """
    order = _order(results, frame, window.view)
    there = np.concatenate([results.present(body, frame) for body in results.bodies])
    order = order[there[order]]
    volume = np.concatenate([results.field(body, "V0") for body in results.bodies])
    sizes = (volume ** (1.0 / results.dim) * window.inches * POINT) ** 2
    x, values = _positions(results, frame)[:, window.view], _values(results, frame, field)
    return x[order], values[order], sizes[order]


# What is drawn of the scene

def _conditions(results):
    """Return the colliders and walls of the scene; None if there are none or it cannot be made
    again.
    """
    try:
        return build_conditions(loads(results.manifest.get("scene") or ""))
    except SceneError:
        return None


def _draw_solids(axes, conditions, window, t):
    """Shade solids at time t and draw their contour, dotted where nodes are prescribed;
    returns what was drawn.
    """
    if conditions is None:
        return []
    right, up, X = _plane(window)
    solid = np.minimum(_to_parts(conditions.colliders, X, t),
                       _to_walls(conditions.walls, X, window.dx))
    drawn = []
    for distance, style in ((solid, "-"), (_to_parts(conditions.prescribed, X, t), ":")):
        if distance.min() < 0.0:
            drawn += _shade(axes, (right, up, distance.reshape(len(up), len(right))), style)
    return drawn


def _shade(axes, field, style):
    """Return the negative side of a field (right, up, values), and its zero contour if there is
    one.
    """
    low, high = field[2].min(), field[2].max()
    drawn = [axes.contourf(*field, [low, 0.0], colors=SHADE, zorder=0)]
    if high > 0.0:
        drawn.append(axes.contour(*field, [0.0], colors=EDGE, linestyles=style, linewidths=0.9,
                                  zorder=1))
    return drawn


def _plane(window):
    """Return points of the picture's plane: their right and up coordinates, and all of them
    (N, d).
    """
    step = window.sides.max() / SAMPLES
    right, up = (np.linspace(*ends, int(np.ceil(side / step)) + 1)
                 for ends, side in zip(window.box, window.sides, strict=True))
    X = np.tile(window.ends.mean(axis=1), (len(up) * len(right), 1))
    X[:, window.view[0]] = np.tile(right, len(up))
    X[:, window.view[1]] = np.repeat(up, len(right))
    return right, up, X


def _to_parts(parts, X, t):
    """Return the distances (N,) at time t to the nearest collider or prescribed region, negative
    inside [m]. Far away where there is none.
    """
    nearest = np.full(len(X), FAR)
    for part in parts:
        motion = getattr(part, "region_motion", part.motion)
        pose = motion.pose(t, 1.0, X.shape[1])
        own = pose.origin + (X - pose.center) @ pose.R[0]       # R^T (x - center), row by row
        side = -1.0 if part.inside else 1.0
        nearest = np.minimum(nearest, side * distances(own, part.shape))
    return nearest


def _to_walls(walls, X, dx):
    """Return the distances (N,) to the walls counted in nodes: to the last of the nodes that they
    hold.
    """
    nearest = np.full(len(X), FAR)
    if walls is None:
        return nearest
    for x, low, high in zip(X.T, walls.low, walls.high, strict=True):
        if low is not None:
            nearest = np.minimum(nearest, x - (low - 1) * dx)
        if high is not None:
            nearest = np.minimum(nearest, (high + 1) * dx - x)
    return nearest
