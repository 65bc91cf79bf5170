"""Pictures of particles as shaded balls in parallel projection: a depth buffer, and light by
normal, hollows and outlines.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import grey_dilation, uniform_filter
from scipy.spatial import cKDTree

FINE = 2                        # subpixels of a pixel along an axis
LIGHT = np.array([-0.45, 0.65, 0.61])       # to the right, up, to the eye
DARK, HOLLOW, LINE = 0.55, 0.5, 0.5       # brightness away from light, in hollows, of outlines
BUMPS = 0.35                    # of the balls themselves, on the normals of the cloud
AROUND = 30                     # neighbours that give a particle its normal


class Balls(NamedTuple):
    """Balls to draw: centres, normals, radii and colours."""

    x: np.ndarray               # (N, 3)  [m]
    n: np.ndarray               # (N, 3)  unit normals; 0 inside of a body
    radius: np.ndarray          # (N,)    [m]
    colour: np.ndarray          # (N, 3)  RGB


class Camera(NamedTuple):
    """An orthographic camera: its angles in degrees, the window that it shows, and its pixels."""

    turn: float                 # about the vertical axis [degrees]
    lift: float                 # above the horizon [degrees]
    low: np.ndarray             # (2,) right and up [m]
    high: np.ndarray            # (2,)
    pixels: int                 # along the longer side

    @property
    def axes(self):
        """Rows: right, up, to the eye; y is vertical."""
        a, b = np.radians(self.turn), np.radians(self.lift)
        right = np.array([np.cos(a), 0.0, -np.sin(a)])
        eye = np.array([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)])
        return np.stack([right, np.cross(eye, right), eye])

    @property
    def per_metre(self):
        """Subpixels of a metre."""
        return FINE * self.pixels / (self.high - self.low).max()


def outward(x):
    """Return the normals (N, 3) of a cloud: away from the mean of the nearest points, 0 inside."""
    if len(x) <= AROUND:
        return np.zeros_like(x)
    far, near = cKDTree(x).query(x, AROUND)
    away = x - x[near].mean(axis=1)
    size = np.linalg.norm(away, axis=1, keepdims=True)
    return np.where(size > 0.12 * far[:, -1:], away / np.maximum(size, 1e-12), 0.0)


def image(balls, camera):
    """Return the RGBA picture (h, w, 4) of balls, transparent where there are none."""
    depth, normal, colour = buffers(balls, camera)
    if not len(balls.x):
        return coarsened(np.zeros((*depth.shape, 4)))
    visible = np.isfinite(depth)
    light = np.clip(normal @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
    bright = DARK + (1.0 - DARK) * light
    size = 2.0 * float(balls.radius.min())
    bright *= 1.0 - HOLLOW * hollows(depth, visible, size, camera.per_metre)
    bright[outlines(depth, visible, 2.5 * size)] *= LINE
    rgb = np.clip(colour * bright[..., None], 0.0, 1.0) + 0.18 * (light**24)[..., None]
    return coarsened(np.dstack([np.clip(rgb, 0.0, 1.0) * visible[..., None], visible]))


def buffers(balls, camera):
    """Return depth to the eye (-inf: nothing), normals and colours of all subpixels, top row
    first.
    """
    width, height = np.ceil((camera.high - camera.low) * camera.per_metre).astype(int)
    depth, which = np.full((height, width), -np.inf), np.zeros((height, width), dtype=int)
    place = balls.x @ camera.axes.T
    spot = (place[:, :2] - camera.low) * camera.per_metre
    extent = balls.radius * camera.per_metre
    for k in range(len(place)):
        rasterize((depth, which), k, spot[k], (place[k, 2], balls.radius[k], extent[k]))
    visible = np.isfinite(depth)
    rows, columns = np.nonzero(visible)
    k = which[visible]
    disc = (np.stack([columns, rows], axis=1) + 0.5 - spot[k]) / extent[k, None]
    round_ = np.column_stack([disc, np.sqrt(np.maximum(1.0 - (disc**2).sum(axis=1), 0.0))])
    cloud = (balls.n @ camera.axes.T)[k]
    blend = cloud + np.where(cloud.any(axis=1, keepdims=True), BUMPS, 1.0) * round_
    normal, colour = np.zeros((height, width, 3)), np.zeros((height, width, 3))
    normal[visible] = blend / np.linalg.norm(blend, axis=1, keepdims=True)
    colour[visible] = balls.colour[k]
    return depth[::-1], normal[::-1], colour[::-1]


def rasterize(canvas, k, spot, ball):
    """Write ball k, at a spot in subpixels, into the depths and the numbers of the front balls."""
    (depth, which), (z, radius, extent) = canvas, ball
    i0, j0 = (max(int(s - extent), 0) for s in spot)
    i1, j1 = (int(s + extent) + 2 for s in spot)
    part = depth[j0:j1, i0:i1]
    if i1 < 0 or j1 < 0 or part.size == 0:
        return
    u = (np.arange(i0, i0 + part.shape[1]) + 0.5 - spot[0]) / extent
    v = (np.arange(j0, j0 + part.shape[0]) + 0.5 - spot[1]) / extent
    w2 = (1.0 - v * v)[:, None] - u * u
    surface = z + radius * np.sqrt(np.maximum(w2, 0.0))
    front = (w2 >= 0.0) & (surface > part)
    part[front] = surface[front]
    which[j0:j1, i0:i1][front] = k


def hollows(depth, visible, size, per_metre):
    """Return the share, 0 to 1, by which subpixels lie behind their surroundings."""
    filled, width = np.where(visible, depth, 0.0), max(int(4.0 * size * per_metre), 1)
    near = smooth(filled, width) / np.maximum(smooth(visible.astype(float), width), 1e-9)
    return np.clip((near - filled) / (4.0 * size), 0.0, 1.0) * visible


def smooth(a, width):
    """Average over a square, twice: nearly a Gaussian, and cheap."""
    return uniform_filter(uniform_filter(a, width), width)


def outlines(depth, visible, step):
    """Mark subpixels next to which the depth jumps towards the eye, or where a body ends."""
    high = np.where(visible, depth, -1e3)
    front = grey_dilation(high, 3)
    return visible & (front - high > step) | ~visible & (front > -1e3)


def coarsened(rgba):
    """Average over FINE x FINE subpixels."""
    h, w = (side // FINE * FINE for side in rgba.shape[:2])
    return rgba[:h, :w].reshape(h // FINE, FINE, w // FINE, FINE, 4).mean(axis=(1, 3))
