"""Small scenes for the tests of sweeps, and the observation of one of them."""

import msgspec
import numpy as np

from mpm_ref.scene import build, digest, loads
from mpm_ref.sweep.observation import ObservedRun
from mpm_ref.sweep.probes import choose_probes

BOUNCE = """
dim = 2
dx = 0.1
end = 0.3
gravity = [0.0, -9.8]
[[body]]
name = "block"
density = 1000.0
shape = { type = "box", lower = [0.2, 0.3], upper = [0.6, 0.7] }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }
velocity = { linear = [0.5, -1.0] }
[[collider]]
name = "floor"
shape = { type = "half_space", point = [0.0, 0.1], normal = [0.0, 1.0] }
"""

FLIGHT = """
dim = 2
dx = 0.1
end = 0.2
gravity = [0.0, -9.8]
[[body]]
name = "disk"
density = 1000.0
shape = { type = "sphere", center = [0.5, 0.7], radius = 0.25 }
material = { law = "fixed_corotated", E = 1e4, nu = 0.3 }
velocity = { linear = [1.0, 0.5] }
"""


def scene_of(text, **keys):
    """Return a scene of a text, with other values of its plain keys."""
    return msgspec.structs.replace(loads(text), **keys) if keys else loads(text)


def observed_run(scene, quantities=("positions",), n=9, **keys):
    """Return the `ObservedRun` of a scene at n even times."""
    probes = tuple((p.body, p.X) for p in choose_probes(build(scene).bodies))
    times = tuple(np.linspace(0.0, scene.end, n).tolist())
    text = msgspec.json.encode(scene).decode()
    return ObservedRun(text, digest(scene), tuple(quantities), times, probes, **keys)
