"""NCLaw's experiment with dough (section 4.6) on synthetic observations: its data are not public.

A known material stands for the dough, that of the authors' release: von Mises at 1 kPa on E = 10
kPa, nu = 0.25. (The release gives stresses an E of 1 MPa beside it; here both laws have one.) It
has fallen half a metre when the run begins, one cell above the floor, a corner first. A camera
observes the points of the front layer, about fifty, at 960 frames a second, with noise.
Laws learn from those places alone, with the paper's prior that velocities in depth are small, and
from how the run began. What they do is then compared with the truth, which is known here: on the
run that was filmed, and on a star.
"""

from functools import cache
from math import sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.nclaw.camera import front_layer, observe_marks, pinhole
from mpm_ref.scene import (
    Body,
    Box,
    Clip,
    Flow,
    Lattice,
    Material,
    Scene,
    Scheme,
    Transformed,
    Union,
    Velocity,
    Walls,
)

from .trained_laws import scene_digest, stored

FRAMES_PER_SECOND, EVERY, FRAMES = 960, 3, 40       # steps between frames; frames after the first
DX, NODES, WALL = 0.01, 24, 3                       # [m], per axis, in each wall
SPACING = 0.0085                                    # of points [m]
G, DROP = 9.8, 0.5                                  # [m/s^2], [m]
E, NU, TAU_Y = 1e4, 0.25, 1e3                       # [Pa], 1, [Pa]
GUESS = {"E": 3e4, "nu": 0.4, "tau_y": 3e3}         # of laws that are a wrong start
MIDDLE = 0.5 * NODES * DX                           # of the box [m]
DEPTH = (0.0, 0.0, 1.0)
BACK, FOCAL, CENTER = 0.5, 1000.0, (960.0, 540.0)   # of the camera [m], [px], [px]
NOISE, SEED = 0.5, 0                                # of each coordinate in the image [px]


class DoughNet(NamedTuple):
    """Settings of the training of laws on the images."""

    elastic: str = "Stress"
    plastic: str = "Correction"
    method: str = "ours"
    epochs: int = 160
    elastic_rate: float = 0.1
    plastic_rate: float = 0.01
    horizon: int = 30           # at first [steps]; after the last epoch the whole run
    depth: float = 0.1          # weight of squared velocities in depth [px^2 s^2/m^2]
    guessed: int = 10           # epochs on labels of a wrong guess, before
    seed: int = 0


def doughs():
    """Return {name: `DoughNet`} of all trainings."""
    return {"dough": DoughNet(), "dough-free": DoughNet(depth=0.0),
            "dough-admissible": DoughNet("Energetic", "Contraction", "admissible", guessed=0)}


def material(E=E, nu=NU, tau_y=TAU_Y):
    """Return the material of the dough, or a guess of it."""
    return Material(law="hencky", E=E, nu=nu, flow=Flow(name="von_mises", tau_y=tau_y, s_min=0.05))


def block():
    """Return a block that stands on a corner."""
    box = Box(lower=(-0.035, -0.025, -0.015), upper=(0.035, 0.025, 0.015))
    return turned(box, 20.0, (MIDDLE, 0.075, MIDDLE))


def star():
    """Return a flat star of five arms."""
    arm = Box(lower=(-0.009, 0.0, -0.015), upper=(0.009, 0.045, 0.015))
    return turned(Union(shapes=tuple(turned(arm, 72.0 * k) for k in range(5))), 10.0,
                  (MIDDLE, 0.09, MIDDLE))


def turned(shape, angle, translate=(0.0, 0.0, 0.0)):
    """Return a shape turned about the axis of depth [degrees], then shifted."""
    return Transformed(shape=shape, angle=angle, axis=DEPTH, about=(0.0, 0.0, 0.0),
                       translate=translate)


def scene(shape, dough=None):
    """Return the scene of the end of the fall of a shape; dough: its material (default: true)."""
    body = Body(name="dough", density=1000.0, shape=shape, material=dough or material(),
                sampling=Lattice(spacing=SPACING),
                velocity=Velocity(linear=(0.0, -sqrt(2.0 * G * DROP), 0.0)))
    return Scene(
        title="NCLaw: dough", dim=3, dx=DX, dt=1.0 / (FRAMES_PER_SECOND * EVERY),
        steps=EVERY * FRAMES, every=EVERY, gravity=(0.0, -G, 0.0), unstable="allow",
        scheme=Scheme(transfer="mls", gravity_on_empty=True), body=(body,),
        walls=Walls(low=3 * (WALL,), high=3 * (NODES - WALL,), kind="separate"),
        clip=Clip(lower=3 * (0.5 * DX,), upper=3 * ((NODES - 0.5) * DX,)))


def camera():
    """Return P (3, 4) of the camera, in front of where the body comes down."""
    return pinhole((MIDDLE, 0.06, MIDDLE + BACK), FOCAL, CENTER)


def observe(x):
    """Return the `Marks` that the camera observes in true frames x (f + 1, n, 3) of the run."""
    return observe_marks(camera(), x, front_layer(x[0]), NOISE, np.random.default_rng(SEED))


@cache
def trained(name):
    """Return the `LearnedLaws` of `doughs` by name; raises as `trained_laws.trained` does."""
    return stored(name, identity(doughs()[name]))


def identity(net):
    """Return the plain values that identify a training."""
    return {"scene": scene_digest(scene(block())), "camera": camera().ravel().tolist(),
            "noise": NOISE, "noise_seed": SEED, **net._asdict()}
