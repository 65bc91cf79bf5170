"""The key `boundary`: conditions at nodes or at the surface of colliders."""

import numpy as np
import pytest

from mpm_ref.core.boundary import Conditions
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.scene import SceneError, build, loads
from mpm_ref.simulate import simulate

SCENE = """
dim = 2
dx = 0.1
steps = 3
gravity = [0.0, -9.8]
[[body]]
name = "block"
density = 1000.0
shape = { type = "box", lower = [0.03, 0.03], upper = [0.43, 0.43] }
material = { law = "fixed_corotated", E = 1e4, nu = 0.3 }
[[collider]]
name = "floor"
shape = { type = "half_space", point = [0.0, 0.03], normal = [0.0, 1.0] }
"""


@pytest.mark.parametrize(("line", "kind"), [
    ("", Conditions), ('boundary = "nodes"', Conditions),
    ('boundary = "surface"', SurfaceConditions)])
def test_the_key_chooses_the_conditions(line, kind):
    assert type(build(loads(line + SCENE)).conditions) is kind


def test_an_unknown_word_is_refused():
    with pytest.raises(SceneError, match="boundary"):
        loads('boundary = "walls"' + SCENE)


def test_implicit_steps_are_refused():
    with pytest.raises(SceneError, match=r'boundary = \'surface\': expected "nodes" with an impl'):
        loads('boundary = "surface"\nintegrator = "hot"' + SCENE)


def test_a_block_that_stands_on_a_sticky_surface_between_nodes_is_held():
    """At nodes its foot falls on, since the wall acts from the node below."""
    fall = {}
    for word in ("nodes", "surface"):
        *_, last = simulate(build(loads(f'boundary = "{word}"' + SCENE)))
        q = last.state.bodies[0].particles
        foot = q.x[:, 1] < 0.1
        fall[word] = float(np.abs(q.v[foot, 1]).max() / (9.8 * last.t))
    assert fall["surface"] < 0.6
    assert fall["surface"] < 0.8 * fall["nodes"]
