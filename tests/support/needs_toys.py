"""Small scenes with ingredients that matter and others that cannot, and runs of them."""

import numpy as np

from mpm_ref.executor import open_executor
from mpm_ref.needs.variant import SceneVariant, first_variant
from mpm_ref.scene import build, loads
from mpm_ref.sweep.observation import ObservedRun
from mpm_ref.sweep.probes import choose_probes
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.store import RunStore

HEAD = """
dim = 2
dx = 0.05
dt = 0.001
end = 0.1
gravity = [0.0, -9.8]
"""
BLOCK = """
[[body]]
name = "block"
density = 1000.0
shape = { type = "box", lower = [0.3, 0.1], upper = [0.5, 0.3] }
velocity = { linear = [0.2, 0.0] }
material = { law = "hencky", E = 1e5, nu = 0.3, flow = { type = "von_mises", tau_y = 1e9 } }
"""
DISTANT = """
[[body]]
name = "distant"
density = 500.0
shape = { type = "box", lower = [2.3, 0.1], upper = [2.5, 0.3] }
material = { law = "hencky", E = 1e5, nu = 0.3 }
"""
FLOOR = """
[[collider]]
name = "floor"
shape = { type = "half_space", point = [0.0, 0.1], normal = [0.0, 1.0] }

[[collider]]
shape = { type = "half_space", point = [-10.0, 0.0], normal = [1.0, 0.0] }
kind = "slip"
friction = 0.3
"""
SCENE = HEAD + BLOCK + DISTANT + FLOOR
# A drop of fluid without an affine field, so that few kernels are compiled.
DROP = """
title = "Drop"
dim = 2
dx = 0.1
dt = 0.002
end = 0.1
gravity = [0.0, -9.8]
scheme = { transfer = "pic", degree = 1 }

[[body]]
name = "drop"
density = 1000.0
shape = { type = "box", lower = [0.2, 0.1], upper = [0.6, 0.5] }
sampling = { type = "regular", per_cell = 1 }
material = { law = "fluid", lam = 1e4 }

[[collider]]
name = "floor"
shape = { type = "half_space", point = [0.0, 0.1], normal = [-0.1, 1.0] }

[[collider]]
name = "roof"
shape = { type = "half_space", point = [0.0, 9.0], normal = [0.0, -1.0] }
"""


class FewOffers(SceneVariant):
    """A variant that offers some removals alone, so that few kernels are compiled."""

    labels = ()

    @property
    def offers(self):
        """The offers among the labels."""
        return {label: one for label, one in super().offers.items() if label in self.labels}


def variant_of(text):
    """The first variant of a scene by its text."""
    scene = loads(text)
    return first_variant(scene, [(p.body, p.X) for p in choose_probes(build(scene).bodies)])


def few_offers(text, labels):
    """The first variant of a scene, which offers some removals alone."""
    first = variant_of(text)
    kind = type("FewOffers", (FewOffers,), {"labels": labels})
    return kind(first.scene, first.probes, first.rows, first.axes)


def runs_of(variant, folder=None, quantities=("positions",), budget=np.inf):
    """`SceneRuns` in this process."""
    times = tuple(np.linspace(0.0, variant.scene.end, 5).tolist())
    observed = ObservedRun("", "", quantities, times, variant.probes)
    with open_executor(workers=1) as executor:
        return SceneRuns(observed, executor, RunStore(folder), budget)
