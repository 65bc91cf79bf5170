"""A law that was learned, of the weights that come along, beside a classical one on one 3D grid."""

import numpy as np
import pytest

from mpm_ref.materials.learned.network import NeuralStress
from mpm_ref.scene import build, loads
from mpm_ref.simulate import simulate
from validation.nclaw.trained_laws import FOLDER

STEPS, DT = 60, 5e-4
NEAR = 0.05         # of what the impact does, which the law was not trained on; it is 0.025 off
LEARNED = 'law = "neural", weights = "jelly.npz"'
TRUE = 'law = "fixed_corotated", E = 1e5, nu = 0.2'
SCENE = f"""
title = "jelly meets sand"
dim = 3
dx = 0.05
dt = {DT}
steps = {STEPS}
every = {STEPS}
gravity = [0.0, 0.0, 0.0]
scheme = {{ transfer = "mls" }}
unstable = "allow"

[[body]]
name = "jelly"
density = 1000.0
shape = {{ type = "box", lower = [0.3, 0.4, 0.4], upper = [0.5, 0.6, 0.6] }}
sampling = {{ type = "lattice", spacing = 0.05 }}
velocity = {{ linear = [2.0, 0.0, 0.0] }}
material = {{ MATERIAL }}

[[body]]
name = "sand"
density = 1000.0
shape = {{ type = "box", lower = [0.5, 0.4, 0.4], upper = [0.7, 0.6, 0.6] }}
sampling = {{ type = "lattice", spacing = 0.05 }}
velocity = {{ linear = [-1.0, 0.0, 0.0] }}
material = {{ law = "hencky", E = 1e6, nu = 0.2, flow = {{ type = "drucker_prager", \
friction_angle = 25.0 }} }}
"""


def problem(material):
    """Jelly, of a material, that runs into sand in free space."""
    return build(loads(SCENE.replace("MATERIAL", material), folder=FOLDER))


def ends(material):
    """Positions (2, n, 3) of both bodies at the end, and momenta (2, 2, 3) at start and end."""
    momenta = []
    for frame in simulate(problem(material)):
        bodies = frame.state.bodies
        momenta.append([body.particles.m @ body.particles.v for body in bodies])
    return [body.particles.x[np.argsort(body.id)] for body in bodies], np.array(momenta)


@pytest.fixture(scope="module")
def learned():
    return ends(LEARNED)


def test_momentum_goes_from_one_to_the_other_and_none_is_lost(learned):
    start, end = learned[1]
    assert abs(end.sum(axis=0) - start.sum(axis=0)).max() < 1e-13 * abs(start).max()
    assert start[:, 0] == pytest.approx((16.0, -8.0))
    assert end[0, 0] < 0.5 * start[0, 0]
    assert end[1, 0] > 0.0


def test_both_bodies_end_where_the_true_law_brings_them(learned):
    true, _ = ends(TRUE)
    flight = [body.particles.x + STEPS * DT * body.particles.v for body in problem(TRUE).bodies]
    for x, there, straight in zip(learned[0], true, flight, strict=True):
        off, done = (np.sqrt(np.mean((a - there) ** 2)) for a in (x, straight))
        assert 0.0 < off < NEAR * done


def test_only_one_of_them_is_learned():
    laws = [type(body.law) for body in problem(LEARNED).bodies]
    assert laws[0] is NeuralStress
    assert laws[1] is not NeuralStress
