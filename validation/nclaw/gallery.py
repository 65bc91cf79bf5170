"""NCLaw's scenes that are only looked at (Figures 3 and 4): a large body, bodies that meet, bodies
of several materials, and some that melt.

Sizes, places, steps and densities are those of the authors' release; bodies: see
`stand_in_bodies`. One grid couples all.
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
# Densities [kg/m^3] and points; points ours, as many for a body's volume as in the release's bunny,
# whose radius is the same.
DESSERT = {"icecream": (1000.0, 31000), "chocolate": (2000.0, 4300)}


def large(spacing=MANY):
    """A dragon of water; points on a lattice `spacing` [m] apart, since a million take long to
    draw.
    """
    scene = environment("water")
    body = with_(scene.body[0], shape=toy("dragon", 0.8), velocity=MILD,
                 sampling=Lattice(spacing=spacing))
    return unit_cube(with_(scene, body=(body,), steps=10000), 64, 0)


def contact(points=TOY_POINTS):
    """Four toys of jelly, of so many points each, that run into each other."""
    scene, sampling = environment("jelly"), Poisson(count=points)
    toys = tuple(with_(thrown_toy(scene, name, *at), sampling=sampling)
                 for name, at in CORNERS.items())
    return unit_cube(with_(scene, body=toys), 32, 1)


def thrown_toy(scene, name, x, z):
    """A toy of a scene's material at (x, 0.4, z), on its way to the middle."""
    way = (SPEED if x < 0.5 else -SPEED, 0.0, SPEED if z < 0.5 else -SPEED)
    return with_(scene.body[0], name=name, shape=toy(name, 0.4, (x, 0.4, z)),
                 velocity=Velocity(linear=way))


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


def dessert():
    """Ice cream and chocolate of plasticine, which rest at the start, in each other as in the
    release; what melts them: see `melting`.
    """
    scene = environment("plasticine")
    bodies = tuple(
        with_(scene.body[0], name=name, shape=toy(name, 0.8, (0.5, 0.2, 0.5)), density=density,
              velocity=Velocity(), sampling=Poisson(count=count))
        for name, (density, count) in DESSERT.items())
    return unit_cube(with_(scene, body=bodies, steps=2000), 64, 3)


def halved(scene):
    """Return a scene with cells of twice the width and an eighth of the points; planes of walls and
    the clip stay where they are.
    """
    walls, last = scene.walls, round(0.5 / scene.dx)
    low = tuple(1 + (k - 1) // 2 for k in walls.low)
    return with_(scene, dx=2.0 * scene.dx,
                 walls=with_(walls, low=low, high=tuple(last - k for k in low)),
                 body=tuple(with_(body, sampling=sparse(body.sampling)) for body in scene.body))


def sparse(sampling):
    """Return a sampling of half the resolution."""
    if isinstance(sampling, Poisson):
        return Poisson(count=round(sampling.count / 8))
    if sampling.spacing is not None:
        return Lattice(spacing=2.0 * sampling.spacing)
    return Lattice(counts=tuple(round(0.5 * count) for count in sampling.counts))
