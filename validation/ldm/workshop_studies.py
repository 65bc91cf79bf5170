"""The workshop paper's experiments as studies (LDMW-unit, LDMW-poke); see `studies`.

Not printed, and chosen here. Unit tests: the cylinder of the pokes, cells of a quarter of its
height, nodes z <= 0 held and those beyond z = 0.35 moved along x; eight speeds up to that of the
pokes, two of them tested; sampled as that cylinder, with seeds that put one of three points in each
third of the height. Poking test: the origin of the poke and its length are those of LDM, so that
the magnitude, in radii, is how far the poked point goes (LDMW-X5); angles are from the horizontal
and from the plane y = 0, as the polar ones, read from the axis, would pull the rim up.
"""

from math import cos, radians, sin

import numpy as np

from mpm_ref.scene import HalfSpace

from ..common.scenes import catalogue_scene, with_
from .studies import LdmStudy, draw_tests, scene_size

CELLS = 4               # over the cylinder's height, in the unit tests
TOP = 0.35              # [m] the nodes beyond are moved; between two layers of them
SEEDS = {3: 2, 17: 0}   # of sampling, by the number of points
SPEEDS = np.linspace(0.06, 0.48, 8)[:, None]                    # [m/s]
RHO, THETA, PHI = (1.0, 1.1, 1.2), (0.0, 4.5, 9.0), (10.0, 12.5, 15.0)  # [R], [deg], [deg]


def sheared(points, v):
    """LDMW-unit: one step in which the top of a cylinder of so many points moves at v [m/s]."""
    scene = catalogue_scene("ldm_poke")
    (base, poke), body = scene.fixed, scene.body[0]
    path = with_(poke.motion.translation, rate=(float(v), 0.0, 0.0))
    top = with_(poke, name="top", region=HalfSpace(point=(0.0, 0.0, TOP), normal=(0.0, 0.0, -1.0)),
                motion=with_(poke.motion, translation=path), until=None)
    sampling = with_(body.sampling, count=points, seed=SEEDS[points])
    return with_(scene, title=f"LDM workshop: sheared cylinder of {points} points",
                 dx=scene_size(poke)[1] / CELLS, steps=1, body=(with_(body, sampling=sampling),),
                 fixed=(base, top))


def pushed(rho, theta, phi):
    """LDMW-poke: the cylinder of which the rim is pushed rho radii far, theta degrees off the plane
    y = 0 and phi degrees downwards.
    """
    scene = catalogue_scene("ldm_poke")
    base, poke = scene.fixed
    theta, phi = radians(theta), radians(phi)
    speed = float(rho) * scene_size(poke)[0] / poke.until
    along = (cos(phi) * cos(theta), cos(phi) * sin(theta), -sin(phi))
    path = with_(poke.motion.translation, rate=tuple(speed * a for a in along))
    return with_(scene, title="LDM workshop: poke", steps=round(poke.until / scene.dt),
                 fixed=(base, with_(poke, motion=with_(poke.motion, translation=path), until=None)))


SHEAR3 = LdmStudy("shear3", SPEEDS, (2, 5), lambda v: sheared(3, v))
SHEAR17 = LdmStudy("shear17", SPEEDS, (2, 5), lambda v: sheared(17, v))
PUSHES = LdmStudy("push", np.array([(rho, theta, phi) for rho in RHO for theta in THETA
                                    for phi in PHI]), draw_tests(5, 27), pushed)
WORKSHOP = {study.name: study for study in (SHEAR3, SHEAR17, PUSHES)}
