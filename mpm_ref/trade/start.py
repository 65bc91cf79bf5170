"""Find settings whose particles represent a body at the start unlike those of the reference.

With two points per cell and axis a layer of particles is dx/2 wide. A body that has lost one has a
face dx/2 and its centroid dx/4 away, so that most of that is a fault.
"""

import numpy as np

from ..scene import build
from ..scene.quantity_records import AXES
from ..sweep.setting import scene_at, setting

FACE, CENTROID = 0.4, 0.2       # dx of the scene as given by which they may be off
FINE_ENOUGH = 0.25              # factor of dx of the reference's grid whose particles are taken


def start_fault(search, chosen):
    """Return in one sentence where the particles of a setting represent a body worst, as far as
    that is a fault; "" where it is none.
    """
    scene = search.scene
    fine = max(search.levels[-1], FINE_ENOUGH)
    reference = starts_of(scene_at(scene, setting(dx=fine)))
    starts = starts_of(scene_at(scene, chosen, search.others))
    faults = [fault_of(name, starts[name], expected, scene.dx)
              for name, expected in reference.items() if name in starts]
    share, text = max(faults, default=(0.0, ""))
    return text if share > 1.0 else ""


def starts_of(scene):
    """Return {body's name: its centroid, lower and upper ends (3, d) [m]} of a scene's particles,
    each as wide as its volume.
    """
    return {body.name: start_of(body.particles) for body in build(scene).bodies}


def start_of(particles):
    """Return the centroid of the mass, the lower and the upper ends (3, d) of particles [m]."""
    x, m = particles.x, particles.m
    half = 0.5 * particles.V0[:, None] ** (1.0 / x.shape[1])
    return np.stack((m @ x / m.sum(), (x - half).min(axis=0), (x + half).max(axis=0)))


def fault_of(name, start, reference, dx):
    """Return how far a body's start (3, d) is from that of the reference, as a share of what it may
    be, and its sentence.
    """
    bound = dx * np.array([CENTROID, FACE, FACE])[:, None]
    share = np.abs(start - reference) / bound
    row, axis = np.unravel_index(np.argmax(share), share.shape)
    what = ("the centroid", "the lower end", "the upper end")[row]
    return float(share[row, axis]), (
        f"at the start, {what} of body {name!r} along {AXES[axis]} lies at "
        f"{start[row, axis]:.4g} m, in the reference at {reference[row, axis]:.4g} m: the "
        "particles of this setting represent the body badly; prefer a dx and points per cell that "
        "divide its size")
