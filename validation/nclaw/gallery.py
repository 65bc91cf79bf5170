"""NCLaw's scenes that are only looked at (Figures 3 and 4): a large body, bodies that meet, bodies
of several materials, and one that melts.

Sizes, places, steps and densities are those of the authors' release; bodies stand for its meshes
(see `toys`). One grid couples all.
"""

from mpm_ref.scene import Box, Lattice, Poisson, Velocity

from ..common.scenes import with_
from .environments import environment
from .stand_in_bodies import toy
from .tasks import MILD, unit_cube

MANY = 0.00274                          # [m], between points of the large body: over a million
DUCK, POOL = 8086, (64, 23, 64)         # points; of the pool along each axis
POOL_AT, POOL_SIZE = (0.49, 0.2, 0.51), (0.85, 0.3, 0.85)      # [m]
CORNERS = {"bunny": (0.25, 0.25), "spot": (0.25, 0.75), "bob": (0.75, 0.25), "blub": (0.75, 0.75)}
SPEED = 2.0                             # of toys to the middle, along x and z [m/s]
TOY_POINTS = 8000                       # ours
CONE_POINTS = 20000                     # ours


def large(spacing=MANY):
    """A dragon of water; points on a lattice, since a million take long to draw."""
    scene = environment("water")
    body = with_(scene.body[0], shape=toy("dragon", 0.8), velocity=MILD,
                 sampling=Lattice(spacing=spacing))
    return unit_cube(with_(scene, body=(body,), steps=10000), 64, 0)


def contact():
    """Four toys of jelly that run into each other."""
    scene = environment("jelly")
    toys = tuple(thrown_toy(scene, name, *at) for name, at in CORNERS.items())
    return unit_cube(with_(scene, body=toys), 32, 1)


def thrown_toy(scene, name, x, z):
    """A toy of a scene's material at (x, 0.4, z), on its way to the middle."""
    way = (SPEED if x < 0.5 else -SPEED, 0.0, SPEED if z < 0.5 else -SPEED)
    return with_(scene.body[0], name=name, shape=toy(name, 0.4, (x, 0.4, z)),
                 velocity=Velocity(linear=way), sampling=Poisson(count=TOY_POINTS))


def pool():
    """A duck of jelly that falls into denser water, on which it floats."""
    jelly, water = (environment(name) for name in ("jelly", "water"))
    duck = with_(jelly.body[0], name="duck", shape=toy("bob", 0.6, (0.5, 0.6, 0.5)),
                 velocity=Velocity(), sampling=Poisson(count=DUCK))
    lower, upper = (tuple(c + sign * 0.5 * s for c, s in zip(POOL_AT, POOL_SIZE, strict=True))
                    for sign in (-1.0, 1.0))
    filled = with_(water.body[0], name="pool", density=3000.0, velocity=Velocity(),
                   shape=Box(lower=lower, upper=upper), sampling=Lattice(counts=POOL))
    return unit_cube(with_(jelly, body=(duck, filled), steps=3000), 64, 3)


def cone():
    """Ice cream of plasticine, which rests at the start; what melts it: see `melting`."""
    scene = environment("plasticine")
    body = with_(scene.body[0], name="icecream", shape=toy("icecream", 0.8), velocity=Velocity(),
                 sampling=Poisson(count=CONE_POINTS))
    return unit_cube(with_(scene, body=(body,), steps=2000), 64, 3)
