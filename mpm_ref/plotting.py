"""Pictures of results: particles coloured by a field, as a figure or as an animation.

3D bodies are seen from the front: gravity points down, the axis that is neither it nor horizontal
is looked along, nearer particles drawn last. Matplotlib is imported when a picture is made.
"""

import numpy as np

from .store.atomic import replacing
from .store.results import SCALARS

AXES = "xyz"
POINT = 72.0      # points per inch, in which marker sizes are given
WIDTH = 4.6       # of the axes [inch]
ROOM = 1.9, 0.8   # for the colour bar and for labels and title [inch]


def view_of(results):
    """(horizontal, vertical) axes, as numbers: up is against gravity, or y without gravity."""
    g = results.gravity
    up = int(np.argmax(np.abs(g))) if np.any(g) else 1
    return (1 if up == 0 else 0), up


def draw(results, frame=-1, field="speed", view=None):
    """Matplotlib `Figure` of the particles of one frame; `field` is one of `results.SCALARS`,
    view the (horizontal, vertical) axes. Raises `BadResults`.
    """
    frame, view = results.index(frame), view or view_of(results)
    return _drawing(results, frame, field, view, _box(results, [frame], view))


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
    figure = _drawing(results, results.index(0), field, view, box)
    axes, points = figure.axes[0], figure.axes[0].collections[0]
    points.set_clim(*_range(_values(results, k, field) for k in frames))

    def show(k):
        x, values, sizes = _dots(results, k, field, view, box)
        points.set(offsets=x, array=values, sizes=sizes)
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
    height = np.clip(WIDTH * (high - low) / (right - left), 1.5, 10.0)
    return WIDTH + ROOM[0], float(height) + ROOM[1]


def _drawing(results, frame, field, view, box):
    """The figure of a frame, with its axes from end to end of a box."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=_size(box), dpi=150, layout="constrained")
    axes = figure.add_subplot()
    axes.set(xlim=box[0], ylim=box[1], aspect="equal",
             xlabel=f"{AXES[view[0]]} [m]", ylabel=f"{AXES[view[1]]} [m]")
    axes.set_title(_title(results, frame), fontsize=9)
    x, values, sizes = _dots(results, frame, field, view, box)
    points = axes.scatter(*x.T, c=values, s=sizes, linewidths=0, cmap="viridis")
    unit = SCALARS[field][0]
    figure.colorbar(points, ax=axes, label=f"{field} [{unit}]" if unit != "1" else field)
    return figure


def _dots(results, frame, field, view, box):
    """Places, values and sizes of the particles from far to near; as wide as they lie apart."""
    order = _order(results, frame, view)
    volume = np.concatenate([results.field(body, "V0") for body in results.bodies])
    inches = WIDTH / (box[0][1] - box[0][0])
    sizes = (volume ** (1.0 / results.dim) * inches * POINT) ** 2
    x, values = _positions(results, frame)[:, view], _values(results, frame, field)
    return x[order], values[order], sizes[order]
