"""Panels that show the particles of a scene at some times of its run."""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import Normalize, to_rgb
from scipy.spatial import cKDTree

from mpm_ref.core.levelset import distances, normals
from mpm_ref.scene.builder import build_conditions
from validation.hot.sizes import sized
from validation.ldm.published_bodies import read

from .splats import Balls, Camera, image, outward
from .style import scales

SOLID, PRESCRIBED = "#d3d6dc", "#8fa3bf"    # of colliders; of prescribed regions, translucent
OPACITY = 0.2
PIXELS, WIDTH = 520, 7.0       # of a picture along its longer side; of the figure [inch]
FINENESS = 90       # of colliders: points along the longer side of the view


class SceneStates(NamedTuple):
    """Particles of a scene at some times of its run."""

    times: np.ndarray       # (shots,) [s]
    body: np.ndarray        # (N,) number of each particle's body
    x: np.ndarray           # (shots, N, 3) [m]; NaN where a particle has not entered
    stress: np.ndarray | None = None    # (shots, N) Frobenius norm of the Kirchhoff stress [Pa],
                                        # of the scenes whose pictures show it


class SceneView(NamedTuple):
    """The pictures, colours and camera with which a figure shows a scene."""

    shots: tuple                    # numbers of the stored states, one for each panel
    colours: tuple                  # of the bodies; with a scalar, the name of its colour map
    turn: float = 25.0              # of the camera: see `Camera`
    lift: float = 15.0
    scalar: tuple | None = None     # (field of `SceneStates`, factor, label)
    low: tuple | None = None        # corner of the box that is shown at least [m]
    high: tuple | None = None
    columns: int = 4
    show_prescribed: bool = True    # whether prescribed regions are shown


def states(results, scene, view):
    """Draw a scene, one panel for each time."""
    history = load_history(results, scene)
    conditions = build_conditions(sized(f"hot_{scene}", "quick"))
    colour_of, colour_scale = colouring(history, view)
    shots = shown_shots(history, view)
    layers = [scene_layers(history, k, conditions, view, colour_of) for k in shots]
    camera = fitted_camera([balls for pair in layers for balls in pair], view)
    figure, axes = panels(camera, len(shots), view.columns)
    for ax, k, (solid, prescribed) in zip(axes, shots, layers, strict=True):
        ax.imshow(composite(image(solid, camera), prescribed, camera))
        ax.set_title(f"t = {history.times[k]:.2f} s")
    return finish(figure, axes, colour_scale, view.scalar and view.scalar[2])


def panels(camera, count, columns, width=WIDTH):
    """Return a figure and its axes, one for each picture and of its shape."""
    columns = min(columns, count)
    rows, (wide, high) = -(-count // columns), camera.high - camera.low
    figure, axes = plt.subplots(rows, columns, squeeze=False, layout="constrained",
                                figsize=(width, (width / columns * high / wide + 0.3) * rows))
    for ax in axes.flat:
        ax.axis("off")
    return figure, axes.flat[:count].tolist()


def finish(figure, axes, colour_scale, label):
    """Add a colour bar for a colour scale, if there is one, and fix the layout of the figure."""
    if colour_scale is not None:
        figure.colorbar(colour_scale, ax=axes, location="bottom", shrink=0.6, aspect=40,
                        pad=0.02).set_label(label)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure


def load_history(results, scene):
    """Return the `SceneStates` that are kept; FileNotFoundError where there are none."""
    return SceneStates(**read(results.folder, f"hot.scenes.{scene}"))


def scene_scale(results, scene):
    """Describe the size of a scene's run."""
    return scales(results, f"hot.scenes.{scene}")


def shown_shots(history, view):
    """Return the numbers of the states to show; a run that was cut short ends with its last."""
    return sorted({min(k, len(history.times) - 1) for k in view.shots})


def colouring(history, view):
    """Return a function that colours all particles at a shot, and the scale of a colour bar."""
    if view.scalar is None:
        palette = np.array([to_rgb(c) for c in view.colours])
        return (lambda k: palette[history.body]), None
    field, factor, _ = view.scalar
    values = factor * getattr(history, field)
    top = np.nanquantile(values[shown_shots(history, view)], 0.95)
    scale = plt.cm.ScalarMappable(Normalize(0.0, top), open_above(view.colours[0]))
    return (lambda k: scale.to_rgba(values[k])[:, :3]), scale


def open_above(colours):
    """Return a colour map by name whose colour bar shows that values may pass its end."""
    shown = plt.get_cmap(colours).with_extremes()
    shown.colorbar_extend = "max"
    return shown


def view_box(history, view):
    """Return the corners (2, 3) of the box to show: all particles, and what the view asks for."""
    x = history.x[shown_shots(history, view)].reshape(-1, 3)
    spare = 0.04 * (np.nanmax(x, axis=0) - np.nanmin(x, axis=0)).max()
    low, high = np.nanmin(x, axis=0) - spare, np.nanmax(x, axis=0) + spare
    return np.stack([low if view.low is None else np.minimum(low, view.low),
                     high if view.high is None else np.maximum(high, view.high)])


def fitted_camera(layers, view):
    """Return the camera of a view whose window holds all balls of some layers."""
    camera = Camera(view.turn, view.lift, np.zeros(2), np.ones(2), PIXELS)
    places = [(balls.x @ camera.axes.T)[:, :2] for balls in layers if len(balls.x)]
    spare = 2.0 * max(balls.radius.max() for balls in layers if len(balls.x))
    return camera._replace(low=np.min([x.min(axis=0) for x in places], axis=0) - spare,
                           high=np.max([x.max(axis=0) for x in places], axis=0) + spare)


def scene_layers(history, k, conditions, view, colour_of):
    """Return the balls of particles and colliders, and those of the prescribed regions."""
    box = view_box(history, view)
    solid = [scene_cloud(history, k, colour_of(k))]
    where = float(history.times[k]), box, np.ptp(box, axis=0).max() / FINENESS
    prescribed = [Balls(*(np.zeros((0, *a.shape[1:])) for a in solid[0]))]
    if conditions is not None:
        solid += [surface(part, where, SOLID) for part in conditions.colliders]
        prescribed += [surface(part, where, PRESCRIBED) for part in conditions.prescribed
                       if view.show_prescribed and is_shown(part, where[0])]
    return join_balls(solid), join_balls(prescribed)


def is_shown(part, t):
    """Return whether a prescribed region is shown at time t [s]: while its nodes are held."""
    return not part.inside and part.since <= t <= part.until


def join_balls(parts):
    """Return all balls of several sets as one."""
    return Balls(*(np.concatenate(a) for a in zip(*parts, strict=True)))


def scene_cloud(history, k, colour):
    """Return the balls of the particles that are there at shot k, of colours (N, 3)."""
    there, first = (np.isfinite(x).all(axis=1) for x in (history.x[k], history.x[0]))
    return cloud(history.x[k, there].astype(float), history.body[there], colour[there],
                 spacing(history.x[0, first]))


def spacing(x):
    """Return the median distance of particles x (n, 3) to their nearest neighbour [m]."""
    return float(np.median(cKDTree(x).query(x, 2)[0][:, 1]))


def cloud(x, body, colour, spacing):
    """Return the balls of particles, with normals from the particles of their own body."""
    n = np.zeros_like(x)
    for b in np.unique(body):
        n[body == b] = outward(x[body == b])
    return Balls(x, n, np.full(len(x), 0.8 * spacing), colour)


def surface(part, where, colour):
    """Return balls on the surface of a collider or region; `where`: time, box and spacing."""
    t, box, fineness = where
    motion = getattr(part, "region_motion", part.motion)
    pose = motion.pose(t, 1.0, 3)
    X = np.stack(np.meshgrid(*(np.arange(a, b, fineness) for a, b in box.T), indexing="ij"),
                 axis=-1).reshape(-1, 3)
    own = pose.origin + (X - pose.center) @ pose.R[0]
    gap = distances(own, part.shape)
    near = abs(gap) < 0.9 * fineness
    n = normals(own[near], part.shape)
    x = pose.center + (own[near] - gap[near, None] * n - pose.origin) @ pose.R[0].T
    side = -1.0 if part.inside else 1.0
    return Balls(x, side * 5.0 * n @ pose.R[0].T, np.full(len(x), 0.75 * fineness),
                 np.tile(to_rgb(colour), (len(x), 1)))


def composite(solid, translucent, camera):
    """Return an RGB picture on white, with a translucent layer of balls over it."""
    picture = solid[..., :3] + 1.0 - solid[..., 3:]
    if not len(translucent.x):
        return picture
    layer = image(translucent, camera)
    return (1.0 - OPACITY * layer[..., 3:]) * picture + OPACITY * layer[..., :3]
