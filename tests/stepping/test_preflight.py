"""Bodies that start in a collider, in a wall or in each other are warned of; touching ones not, but
for thin ones.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_runs import DX, block, colliding

from mpm_ref.body import particles_at
from mpm_ref.body_contact import BodyContact
from mpm_ref.core import motion
from mpm_ref.core.boundary import BoxWalls, Collider, Conditions, Prescribed
from mpm_ref.core.levelset import box, half_space
from mpm_ref.preflight import misplaced
from mpm_ref.scene import build, load, loads

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.toml"))
FLOOR = half_space((0.0, 0.5), (0.0, 1.0))      # the left block stands on it exactly
DOWN = motion.Motion(translation=motion.Steady(np.array([0.0, -9.0])))


def left(conditions, corner=(0.2, 0.5)):
    """A block of 8 x 8 particles, DX/2 apart, with conditions."""
    problem = colliding(conditions=conditions)
    return replace(problem, bodies=(block("left", corner, (0.0, 0.0)),))


def collider(*args, **more):
    return Conditions(colliders=(Collider(*args, **more),))


def walls(low):
    return Conditions(walls=BoxWalls((None, low), (None, None)))


SUNK = (0.2, 0.5 - 0.6 * DX)                    # one row is below the floor, by 0.35 dx
ROOM = box((0.2, 0.5), (0.2 + 4 * DX, 0.5 + 4 * DX))
TURNED = motion.Motion(center=(0.2, 0.5), orientation=motion.rotation(np.pi))


@pytest.mark.parametrize(("conditions", "corner"), [
    (None, SUNK),
    (collider(FLOOR), (0.2, 0.5)),
    (collider(FLOOR), (0.2, 0.5 - 0.25 * DX)),                  # the first row is on the surface
    (collider(FLOOR, motion=DOWN), (0.2, 0.5)),
    (collider(ROOM, inside=True), (0.2, 0.5)),
    (collider(ROOM, motion=TURNED), (0.2, 0.5)),
    (Conditions(prescribed=(Prescribed(FLOOR),)), SUNK),        # meant to hold what is in it
    (walls(11), (0.2, 0.5)),                                    # its first node is at 10 dx = 0.5
], ids=["none", "on", "at", "moving", "in a room", "turned away", "held", "on a wall"])
def test_what_stands_well_is_not_warned_of(conditions, corner):
    assert misplaced(left(conditions, corner)) == []


@pytest.mark.parametrize(("conditions", "count", "depth", "name"), [
    (collider(FLOOR), 8, 0.35, "collider[0]"),
    (collider(FLOOR, motion=DOWN), 8, 0.35, "collider[0]"),
    (collider(ROOM, inside=True), 8, 0.35, "collider[0]"),
    (walls(11), 8, 0.35, "the low wall of axis 1"),
    (collider(half_space((0.2, 0.5), (0.0, -1.0)), motion=TURNED), 8, 0.35, "collider[0]"),
    (collider(half_space((0.2 + DX, 0.0), (1.0, 0.0))), 16, 0.75, "collider[0]"),
], ids=["on", "moving", "room", "wall", "turned", "wall at the side"])
def test_particles_in_a_solid_are_counted(conditions, count, depth, name):
    said, = misplaced(left(conditions, SUNK))
    assert said.startswith(f"{count} of the 64 particles of body 'left' start inside {name}, "
                           f"up to {depth * DX:.3g} m deep ({depth:.3g} dx); ")


def test_a_high_wall():
    said, = misplaced(left(Conditions(walls=BoxWalls((None, None), (None, 12)))))   # at 13 dx
    assert said.startswith("16 of the 64 particles of body 'left' start inside the high wall of "
                           "axis 1, up to 0.0375 m deep")


# bodies in each other: the second one stands at the right of the first

PAIR = """
dim = {d}
dx = 0.05
steps = 1
{bodies}
"""
BODY = """
[[body]]
name = "{name}"
density = 1.0
shape = {{ type = "box", lower = {lower}, upper = {upper} }}
sampling = {{ {sampling} }}
material = {{ law = "fluid", lam = 1.0 }}
"""
REGULAR, FINE = 'type = "regular", per_cell = 2', 'type = "regular", per_cell = 3'
JITTERED, POISSON = 'type = "jittered", per_cell = 2', 'type = "poisson", per_cell = 2'
LATTICE = 'type = "lattice", spacing = 0.02'


def pair(d, samplings, overlap):
    """Two boxes of 6 cells along each axis, the one deeper than the other's face by `overlap`."""
    bodies = ""
    for k, sampling in enumerate(samplings):
        start = k * (0.3 - overlap)
        lower, upper = [start] + (d - 1) * [0.0], [start + 0.3] + (d - 1) * [0.3]
        bodies += BODY.format(name="ab"[k], lower=lower, upper=upper, sampling=sampling)
    return build(loads(PAIR.format(d=d, bodies=bodies)))


@pytest.mark.parametrize("samplings", [
    (REGULAR, REGULAR), (REGULAR, FINE), (FINE, JITTERED), (JITTERED, JITTERED),
    (POISSON, POISSON), (LATTICE, REGULAR), (LATTICE, POISSON),
], ids=lambda pair: " ".join(s.split('"')[1] for s in pair))
def test_bodies_that_overlap_are_told_from_those_that_touch(d, samplings):
    assert misplaced(pair(d, samplings, overlap=0.0)) == []
    assert misplaced(pair(d, samplings, overlap=-0.1)) == []
    said, = misplaced(pair(d, samplings, overlap=0.06))
    assert said.startswith("bodies 'a' and 'b' overlap at the start, about (0.2")
    assert "particles of 'a' are where 'b' is" in said


def test_a_small_body_in_a_large_one_is_seen_from_either():
    for names in (("left", "right"), ("right", "left")):
        bodies = [block(name, corner, (0.0, 0.0), cells) for name, corner, cells in zip(
            names, ((0.0, 0.0), (0.4, 0.4)), (20, 2), strict=True)]
        assert len(misplaced(replace(colliding(), bodies=tuple(bodies)))) == 1
        assert len(misplaced(replace(colliding(), bodies=tuple(bodies[::-1])))) == 1


def test_compressed_particles_take_less_room():
    """Two bodies at half their volume are where one has room."""
    bodies = [block(name, (0.0, 0.0), (0.0, 0.0), fluid=True) for name in "ab"]
    problem = replace(colliding(), bodies=tuple(bodies))
    assert len(misplaced(problem)) == 1
    for body in bodies:
        body.particles.F[:] = 0.5
    assert misplaced(problem) == []


@pytest.mark.parametrize(       # "nsf_sand" takes seconds to fill, HOT's are in test_hot_scenes
    "file", [f for f in SCENES if f.stem != "nsf_sand" and not f.stem.startswith("hot_")],
    ids=lambda file: file.stem)
def test_bundled_scenes_stand_well(file):
    assert misplaced(build(load(file))) == []


# thin bodies in contact

TOUCH = (BodyContact(("left", "plate")),)


def with_plate(height, angle=0.0, contacts=TOUCH):
    """The left block and a plate far from it, `height` cells thick and ten long, turned."""
    x = DX * np.stack(np.meshgrid(np.arange(0.25, 10.0, 0.5), np.arange(0.25, height, 0.5)),
                      axis=-1).reshape(-1, 2)
    c, s = np.cos(angle), np.sin(angle)
    V = np.full(len(x), 0.25 * DX**2)
    particles = particles_at(x @ [[c, s], [-s, c]] + 3.0, np.zeros_like(x), 1e3 * V, V, "mls")
    problem = left(None)
    plate = problem.bodies[0]._replace(name="plate", particles=particles, id=np.arange(len(x)))
    return replace(problem, bodies=(*problem.bodies, plate), contacts=contacts)


@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_thin_bodies_that_others_touch_are_warned_of(angle):
    (sentence,) = misplaced(with_plate(1.5, angle))
    assert sentence.startswith("body 'plate' is 1.5 dx thick, less than 2: contact measures gaps")
    assert misplaced(with_plate(2.0, angle)) == []


@pytest.mark.parametrize("contacts", [(), (BodyContact(("left", "plate"), kind="stick"),)])
def test_thin_bodies_that_only_stick_are_not_warned_of(contacts):
    assert misplaced(with_plate(0.5, contacts=contacts)) == []


def test_a_single_particle_is_thin():
    (sentence,) = misplaced(one_particle())
    assert "body 'plate' is 0.5 dx thick" in sentence


def one_particle():
    """The left block, and a plate of one particle."""
    problem = with_plate(0.5)
    block, plate = problem.bodies
    q = plate.particles
    single = particles_at(q.x[:1], q.v[:1], q.m[:1], q.V0[:1], "mls")
    return replace(problem, bodies=(block, plate._replace(particles=single, id=np.arange(1))))
