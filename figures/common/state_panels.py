"""What the state figures share: panels of a scene's particles at some times of its whole run."""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import Normalize, to_rgb
from scipy.spatial import cKDTree

from mpm_ref.core.levelset import distances, normals
from mpm_ref.scene.builder import build_conditions
from validation.hot.run_history import read
from validation.hot.sizes import sized

from .orders import scales
from .splats import Balls, Camera, image, outward

SOLID, HELD = "#d3d6dc", "#8fa3bf"      # of colliders; of prescribed regions, which shine through
SHINE = 0.2
PIXELS, WIDTH = 520, 10.0      # of a picture along its longer side; of the figure [inch]
FINENESS = 90       # of colliders: points along the longer side of what is seen


class Look(NamedTuple):
    """How a scene is shown."""

    shots: tuple                    # numbers of the pictures kept, one for each panel
    colours: tuple                  # of the bodies; with a scalar, the name of its colour map
    turn: float = 25.0              # of the camera: see `Camera`
    lift: float = 15.0
    scalar: tuple | None = None     # (field of `Course`, factor, words)
    low: tuple | None = None        # corner of what is seen at least [m]
    high: tuple | None = None
    columns: int = 4
    held: bool = True               # whether prescribed regions are shown


def states(results, scene, look):
    """The figure of a scene, one panel for each time."""
    course = known(results, scene)
    conditions = build_conditions(sized(f"hot_{scene}", "quick"))
    paint, shown = colouring(course, look)
    shots = kept(course, look)
    layers = [layers_of(course, k, conditions, look, paint) for k in shots]
    camera = framed([balls for pair in layers for balls in pair], look)
    figure, axes = panels(camera, len(shots), look.columns)
    for ax, k, (solid, held) in zip(axes, shots, layers, strict=True):
        ax.imshow(shone(image(solid, camera), held, camera))
        ax.set_title(f"t = {course.times[k]:.2f} s", fontsize=9)
    return settled(figure, axes, shown, look.scalar and look.scalar[2])


def panels(camera, count, columns, width=WIDTH):
    """A figure and as many axes as there are pictures, of their shape."""
    columns = min(columns, count)
    rows, (wide, high) = -(-count // columns), camera.high - camera.low
    figure, axes = plt.subplots(rows, columns, squeeze=False, layout="constrained",
                                figsize=(width, (width / columns * high / wide + 0.3) * rows))
    for ax in axes.flat:
        ax.axis("off")
    return figure, axes.flat[:count].tolist()


def settled(figure, axes, shown, words):
    """The figure with a colour bar of what is shown, if there is any; laid out for good."""
    if shown is not None:
        figure.colorbar(shown, ax=axes, shrink=0.8, aspect=30, pad=0.01).set_label(words)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure


def known(results, scene):
    """The course of a scene; FileNotFoundError where its states are not here."""
    file = results.folder / "states" / f"{scene}.npz"
    course = read(file)
    if course is None:
        raise FileNotFoundError(f"{file} is not published: run hot.scenes.{scene} again for it")
    return course


def said(results, scene):
    """How large the run was."""
    return scales(results, f"hot.scenes.{scene}")


def kept(course, look):
    """Those of the pictures to show that there are; a run cut short ends with its last."""
    return sorted({min(k, len(course.times) - 1) for k in look.shots})


def colouring(course, look):
    """(colours of all particles at a shot, what a colour bar shows or None)."""
    if look.scalar is None:
        palette = np.array([to_rgb(c) for c in look.colours])
        return (lambda k: palette[course.body]), None
    field, factor, _ = look.scalar
    values = factor * getattr(course, field)
    top = np.quantile(values[kept(course, look)], 0.95)
    shown = plt.cm.ScalarMappable(Normalize(0.0, top), look.colours[0])
    return (lambda k: shown.to_rgba(values[k])[:, :3]), shown


def ends_of(course, look):
    """Corners (2, 3) of what is seen: all particles, and as much of the scene as is asked for."""
    x = course.x[kept(course, look)].reshape(-1, 3)
    spare = 0.04 * np.ptp(x, axis=0).max()
    low, high = x.min(axis=0) - spare, x.max(axis=0) + spare
    return np.stack([low if look.low is None else np.minimum(low, look.low),
                     high if look.high is None else np.maximum(high, look.high)])


def framed(layers, look):
    """The camera that sees all balls of some layers."""
    camera = Camera(look.turn, look.lift, np.zeros(2), np.ones(2), PIXELS)
    seen = [(balls.x @ camera.axes.T)[:, :2] for balls in layers if len(balls.x)]
    spare = 2.0 * max(balls.radius.max() for balls in layers if len(balls.x))
    return camera._replace(low=np.min([x.min(axis=0) for x in seen], axis=0) - spare,
                           high=np.max([x.max(axis=0) for x in seen], axis=0) + spare)


def layers_of(course, k, conditions, look, paint):
    """Balls of particles and colliders, and those of the regions that are prescribed."""
    ends = ends_of(course, look)
    solid = [cloud(course.x[k].astype(float), course.body, paint(k), spacing(course.x[0]))]
    where = float(course.times[k]), ends, np.ptp(ends, axis=0).max() / FINENESS
    held = [Balls(*(np.zeros((0, *a.shape[1:])) for a in solid[0]))]
    if conditions is not None:
        solid += [surface(part, where, SOLID) for part in conditions.colliders]
        held += [surface(part, where, HELD) for part in conditions.prescribed
                 if look.held and not part.inside]
    return joined(solid), joined(held)


def joined(parts):
    return Balls(*(np.concatenate(a) for a in zip(*parts, strict=True)))


def spacing(x):
    """Median distance of a particle (n, 3) to the nearest [m]."""
    return float(np.median(cKDTree(x).query(x, 2)[0][:, 1]))


def cloud(x, body, colour, spacing):
    """Balls of particles, with normals from the particles of their own body."""
    n = np.zeros_like(x)
    for b in np.unique(body):
        n[body == b] = outward(x[body == b])
    return Balls(x, n, np.full(len(x), 0.8 * spacing), colour)


def surface(part, where, colour):
    """Balls on the surface of a collider or region; `where` is a time, a box, how far apart."""
    t, ends, fineness = where
    motion = part.motion if getattr(part, "follows", True) else part.motion.at_rest
    pose = motion.pose(t, 1.0, 3)
    X = np.stack(np.meshgrid(*(np.arange(a, b, fineness) for a, b in ends.T), indexing="ij"),
                 axis=-1).reshape(-1, 3)
    own = pose.origin + (X - pose.center) @ pose.R[0]
    gap = distances(own, part.shape)
    near = abs(gap) < 0.9 * fineness
    n = normals(own[near], part.shape)
    x = pose.center + (own[near] - gap[near, None] * n - pose.origin) @ pose.R[0].T
    side = -1.0 if part.inside else 1.0
    return Balls(x, side * 5.0 * n @ pose.R[0].T, np.full(len(x), 0.75 * fineness),
                 np.tile(to_rgb(colour), (len(x), 1)))


def shone(solid, held, camera):
    """RGB picture on white, with a translucent layer of balls over it."""
    picture = solid[..., :3] + 1.0 - solid[..., 3:]
    if not len(held.x):
        return picture
    layer = image(held, camera)
    return (1.0 - SHINE * layer[..., 3:]) * picture + SHINE * layer[..., :3]
