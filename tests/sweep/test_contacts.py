"""Contacts by the distance of surfaces: of disks and colliders placed at given gaps."""

import numpy as np
import pytest
from sweep_scenes import BOUNCE, observed_run, scene_of

from mpm_ref.scene import build, loads
from mpm_ref.sweep.contacts import ContactRecorder, body_gaps, distance, solid_gaps, spacing
from mpm_ref.sweep.observation import observe

BLOCKS = """
dim = {dim}
dx = 0.1
end = 0.1
gravity = {gravity}
walls = {{ low = {low}, high = {high} }}
[[body]]
name = "left"
density = 1000.0
sampling = {{ type = "regular", per_cell = 2 }}
shape = {{ type = "box", lower = {lower}, upper = {upper} }}
material = {{ law = "fixed_corotated", E = 1e5, nu = 0.3 }}
[[body]]
name = "right"
density = 1000.0
sampling = {{ type = "regular", per_cell = 2 }}
shape = {{ type = "box", lower = {next_lower}, upper = {next_upper} }}
material = {{ law = "fluid", lam = 1e5 }}
"""


def blocks(dim, gap):
    """Return the problem of two cubes of 0.4 m with a gap [m]; the left is 0.4 m from a wall."""
    rest, high = [0.4] * (dim - 1), ["open"] * dim
    return build(loads(BLOCKS.format(
        dim=dim, gravity=[0.0] * dim, low=[1] + ["open"] * (dim - 1), high=high,
        lower=[0.4, *rest], upper=[0.8] * dim, next_lower=[0.8 + gap, *rest],
        next_upper=[1.2 + gap] + [0.8] * (dim - 1)).replace("'", '"')))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(("gap", "touches"), [(0.0, True), (0.05, True), (0.15, False)])
def test_bodies_are_in_contact_within_a_cell(dim, gap, touches):
    problem = blocks(dim, gap)
    gaps = body_gaps(problem.bodies, problem.dx)
    assert list(gaps) == [("body 'left' with body 'right'", ("left", "right"))] * touches
    assert list(gaps.values()) == [pytest.approx(gap + 0.05)] * touches      # of the particles


@pytest.mark.parametrize("dim", [2, 3])
def test_walls_are_solids(dim):
    problem = blocks(dim, 1.0)
    assert solid_gaps(problem, problem.bodies, 0.0) == {}
    problem.bodies[0].particles.x[:, 0] -= 0.31
    gaps = solid_gaps(problem, problem.bodies, 0.0)
    assert gaps == {("body 'left' with the low wall of axis 0", ("left",)): pytest.approx(0.115)}


def test_spacing_is_that_of_the_sampling():
    assert spacing(blocks(2, 0.0).bodies[0]) == pytest.approx(0.05)


def test_distance_is_that_of_all_pairs():
    rng = np.random.default_rng(0)
    x, y = rng.random((20, 3)), rng.random((30, 3)) + [1.2, 0.0, 0.0]
    pairs = np.linalg.norm(x[:, None] - y, axis=2).min()
    assert distance(x, y, 2.0) == pytest.approx(pairs)
    assert distance(x, y + 5.0, 2.0) == np.inf


def test_contact_is_noted_during_the_run_alone():
    scene = scene_of(BOUNCE)
    assert observe(observed_run(scene)).contacts == ("body 'block' with collider[0] 'floor'",)
    problem = build(scene)
    assert list(solid_gaps(problem, problem.bodies, 0.0)) == []


def test_a_moving_collider_comes_near():
    text = BOUNCE + 'motion = { translation = { type = "steady", rate = [0.0, 0.5] } }\n'
    problem = build(loads(text))
    assert list(solid_gaps(problem, problem.bodies, 0.0)) == []
    assert list(solid_gaps(problem, problem.bodies, 0.25))


def test_a_quick_contact_between_two_observations_is_noted():
    """The block falls 0.2 m at 30 m/s, and is gone long before the only other observation."""
    text = BOUNCE.replace("[0.5, -1.0]", "[0.0, -30.0]").replace("E = 1e5", "E = 1e7")
    result = observe(observed_run(loads(text), n=2))
    assert result.contacts == ("body 'block' with collider[0] 'floor'",)


def record(gaps, ways):
    """Return the texts that a recorder notes of two cubes at some gaps, the right one having moved
    by some ways between them.
    """
    recorder = ContactRecorder(blocks(2, gaps[0]))
    for gap, way in zip(gaps, ways, strict=True):
        recorder.note(blocks(2, gap).bodies, 0.0, {"left": 0.0, "right": way})
    return list(recorder.contacts)


@pytest.mark.parametrize(("gaps", "ways", "noted"), [
    ((0.08, 0.05, 0.02), (0.0, 0.03, 0.03), False),         # falls freely, near from the start on
    ((0.08, 0.05, 0.02, 0.01), (0.0, 0.03, 0.03, 0.03), True),      # and is stopped
    ((0.05, 0.05), (0.0, 0.0), True),                       # rests
    ((0.15, 0.02, 0.06), (0.0, 0.13, 0.04), True),          # bounces between two looks
    ((0.05, 0.08), (0.0, 0.03), True),                      # leaves
    ((0.3, 0.2), (0.0, 0.0), False),                        # never comes near
])
def test_what_still_approaches_freely_has_no_contact(gaps, ways, noted):
    assert record(gaps, ways) == ["body 'left' with body 'right'"] * noted


@pytest.mark.parametrize(("end", "noted"), [(0.02, False), (0.3, True)])
def test_a_body_that_starts_near_its_floor_has_no_contact_before_it_gets_there(end, noted):
    """The floor is 0.06 m below, within a cell of 0.1 m; in 0.02 s gravity takes the block 2 mm."""
    text = BOUNCE.replace("[0.5, -1.0]", "[0.0, 0.0]").replace("[0.2, 0.3]", "[0.2, 0.16]")
    result = observe(observed_run(loads(text.replace("end = 0.3", f"end = {end}"))))
    assert result.contacts == ("body 'block' with collider[0] 'floor'",) * noted


def test_a_step_that_is_looked_at_twice_makes_no_contact():
    """The floor is 0.09 m below the block, which falls 9 mm in a step; the third takes it past a
    quarter of a cell, and is near the last time of observation.
    """
    text = BOUNCE.replace("[0.5, -1.0]", "[0.0, -9.0]").replace("[0.2, 0.3]", "[0.2, 0.19]")
    text = text.replace("end = 0.3", 'end = 0.004\nintegrator = "hot"\nlongest = 0.001')
    result = observe(observed_run(loads(text), n=2))
    assert result.cost.steps == 4
    assert result.contacts == ()


def test_what_others_do_and_what_slides_aside_makes_no_contact():
    """A third body moves fast; the left one slides aside while the right one comes."""
    recorder = ContactRecorder(blocks(2, 0.1))
    for gap in (0.1, 0.05, 0.0):
        recorder.note(blocks(2, gap).bodies, 0.0, {"left": 0.06, "right": 0.05, "third": 9.0})
    assert not recorder.contacts
