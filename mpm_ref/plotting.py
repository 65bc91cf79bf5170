"""Pictures of results: particles coloured by a field, as a figure or as an animation.

3D bodies are seen from the front: gravity points down, the axis that is neither it nor horizontal
is looked along, nearer particles drawn last. Matplotlib is imported when a picture is made.
"""

import numpy as np

from .atomic import replacing
from .results import SCALARS

AXES = "xyz"
POINT = 72.0      # points per inch, in which marker sizes are given
WIDTH = 6.0       # of the figure [inch]


def view_of(results):
    """(horizontal, vertical) axes, as numbers: up is against gravity, or y without gravity."""
    g = results.gravity
    up = int(np.argmax(np.abs(g))) if np.any(g) else 1
    return (1 if up == 0 else 0), up


def draw(results, frame=-1, field="speed", view=None):
    """Matplotlib `Figure` of the particles of one frame; `field` is one of `results.SCALARS`,
    view the (horizontal, vertical) axes. Raises `BadResults`.
    """
    from matplotlib.figure import Figure

    frame = results.index(frame)
    view = view or view_of(results)
    box = _box(results, [frame], view)
    figure = Figure(figsize=_size(box), dpi=150, layout="constrained")
    axes = figure.add_subplot()
    values = _values(results, frame, field)
    points = _scatter(axes, results, frame, values, (box, view))
    unit = SCALARS[field][0]
    figure.colorbar(points, ax=axes, label=f"{field} [{unit}]" if unit != "1" else field)
    axes.set_title(_title(results, frame), fontsize=9)
    return figure


def save_plot(results, out, **what):
    """Write `draw(results, **what)` to an image file, png, pdf or svg as its suffix says."""
    figure = draw(results, **what)
    with replacing(out) as part:
        figure.savefig(part)


def animate(results, out, field="speed", view=None, fps=20):
    """Write a GIF of all frames, on fixed axes and one colour scale. Raises `BadResults`."""
    from matplotlib.animation import FuncAnimation, PillowWriter

    view, frames = view or view_of(results), range(len(results))
    box = _box(results, frames, view)
    scale = _range(_values(results, k, field) for k in frames)
    figure = draw(results, 0, field, view)
    figure.set_size_inches(_size(box))
    axes, points = figure.axes[0], figure.axes[0].collections[0]
    points.set_clim(*scale)
    axes.set(xlim=box[0], ylim=box[1])

    def show(k):
        order = _order(results, k, view)
        points.set_offsets(_positions(results, k)[order][:, view])
        points.set_array(_values(results, k, field)[order])
        axes.set_title(_title(results, k), fontsize=9)
        return [points]

    film = FuncAnimation(figure, show, frames)
    with replacing(out) as part:
        film.save(part, writer=PillowWriter(fps=fps), dpi=80)


def _title(results, frame):
    return f"{results.title or results.path.name}, t = {results.time[frame]:.4g} s"


def _positions(results, frame):
    return np.concatenate([results.field(body, "x", frame) for body in results.bodies])


def _values(results, frame, field):
    return np.concatenate([results.scalar(body, field, frame) for body in results.bodies])


def _order(results, frame, view):
    """Particles from far to near."""
    x = _positions(results, frame)
    depth = [a for a in range(results.dim) if a not in view]
    return np.argsort(-x[:, depth[0]], kind="stable") if depth else np.arange(len(x))


def _range(arrays):
    """Smallest and largest finite value."""
    finite = [a[np.isfinite(a)] for a in arrays]
    ends = [(a.min(), a.max()) for a in finite if len(a)] or [(0.0, 1.0)]
    return min(low for low, _ in ends), max(high for _, high in ends)


def _box(results, frames, view):
    """Ends of the horizontal and of the vertical axis, with a cell to spare."""
    ends = [_range(_positions(results, k)[:, a] for k in frames) for a in view]
    return [(low - results.dx, high + results.dx) for low, high in ends]


def _size(box):
    (left, right), (low, high) = box
    return WIDTH, float(np.clip(WIDTH * (high - low) / (right - left), 2.0, 10.0)) + 0.5


def _scatter(axes, results, frame, values, frame_of):
    """Particles as dots about half a cell wide."""
    (horizontal, vertical), view = frame_of
    order = _order(results, frame, view)
    x = _positions(results, frame)[order][:, view]
    inches = WIDTH * 0.8 / (horizontal[1] - horizontal[0])
    size = np.clip((0.5 * results.dx * inches * POINT) ** 2, 0.2, 200.0)
    axes.set(xlim=horizontal, ylim=vertical, aspect="equal",
             xlabel=f"{AXES[view[0]]} [m]", ylabel=f"{AXES[view[1]]} [m]")
    return axes.scatter(*x.T, c=values[order], s=size, linewidths=0, cmap="viridis")
