"""NCLaw's tasks as scenes (NCLAW-eval): the training run again, and four ways to leave it.

    reconstruction  the training run
    time            (a) twice as long, water five times
    velocity        (b) three other velocities
    geometry        (c) other bodies, of thirty times as many points, on a finer grid
    slope           (d) a body on an inclined plane, only to be looked at

What the text leaves out is as in the authors' release. Bodies of (c) and (d): see `toys`.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.scene import Clip, Poisson, Velocity, Walls

from ..common.scenes import with_
from .environments import environment
from .stand_in_bodies import toy

CENTER = (0.5, 0.5, 0.5)                    # about which bodies spin [m]
LONG = {"jelly": 2000, "sand": 2000, "plasticine": 2000, "water": 5000}     # steps
SEEDS = (1, 7, 8)                           # of velocities
FASTEST = 3.0                               # [m/s], of each component of a spin [rad/s]
MILD = Velocity(linear=(1.0, -1.5, -1.5), angular=(1.0, 1.0, 1.0), center=CENTER)
WALL = 3                                    # nodes


class Toy(NamedTuple):
    """A body of task (c)."""

    name: str
    size: float         # largest edge [m]
    points: int
    clip: int           # cells between positions and the edge of the unit cube


TOYS = {"jelly": Toy("armadillo", 0.7, 34468, 1), "sand": Toy("blub", 0.8, 31780, 3),
        "plasticine": Toy("bunny", 0.7, 33450, 3), "water": Toy("spot", 0.8, 31580, 3)}


def reconstruction(name):
    """The scene that an environment's laws are trained on."""
    return environment(name)


def time(name):
    """An environment for longer."""
    return environment(name, steps=LONG[name])


def velocity(name, seed):
    """An environment's cube, thrown otherwise."""
    scene = environment(name)
    return with_(scene, body=(with_(scene.body[0], velocity=thrown(seed)),))


def thrown(seed):
    """The velocity that the release draws from a seed; never upwards."""
    draw = np.random.Generator(np.random.PCG64(seed))
    way = draw.uniform(-1.0, 1.0, 3)
    way[1] = -abs(way[1])
    linear = draw.uniform(0.0, FASTEST) * way / np.linalg.norm(way)
    return Velocity(linear=tuple(linear.tolist()), center=CENTER,
                    angular=tuple(draw.uniform(0.0, FASTEST, 3).tolist()))


def geometry(name):
    """An environment's material in another shape, on 32 nodes per axis."""
    scene, of = environment(name), TOYS[name]
    body = with_(scene.body[0], shape=toy(of.name, of.size), velocity=MILD,
                 sampling=Poisson(count=of.points))
    return unit_cube(with_(scene, body=(body,), steps=2000), 32, of.clip)


def slope():
    """A small body of dense water on a plane inclined by turning, and weakening, gravity."""
    scene = environment("water")
    body = with_(scene.body[0], shape=toy("dragon30", 0.1, (0.5, 0.075, 0.3)), density=5000.0,
                 velocity=Velocity(), sampling=Poisson(count=30000))
    return unit_cube(with_(scene, body=(body,), steps=1500, gravity=(0.0, -1.0, 0.866)), 128, 3)


def unit_cube(scene, nodes, clip):
    """A scene on a grid of so many nodes per axis in its box, all points so many cells inside;
    without the mass that is added to nodes.
    """
    dx, inner = 1.0 / nodes, clip / nodes
    return with_(scene, dx=dx, scheme=with_(scene.scheme, mass_eps=0.0),
                 walls=Walls(low=(WALL,) * 3, high=(nodes - WALL,) * 3, kind="separate"),
                 clip=Clip(lower=(inner,) * 3, upper=(1.0 - inner,) * 3))


def scenes(task, name):
    """The scenes of a task in an environment: one, of "velocity" one of each seed."""
    if task == "velocity":
        return [velocity(name, seed) for seed in SEEDS]
    return [{"reconstruction": reconstruction, "time": time, "geometry": geometry}[task](name)]
