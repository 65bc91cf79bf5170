"""The time in which a wave crosses a cell, the natural unit of the relaxation of a transfer."""

from math import sqrt

from ..materials import stiffness
from .validate import check_scene


def crossing_time(scene):
    """Return dx/c [s] of a `Scene`, c the speed of the fastest compression wave of its bodies at
    rest; None where the file of a body holds its density or its law.
    """
    materials = (scene.parts or check_scene(scene)).materials
    densities = [body.density for body in scene.body]
    if None in (*materials, *densities):
        return None
    return scene.dx / max(sqrt(stiffness(law) / rho)
                          for (law, _), rho in zip(materials, densities, strict=True))
