"""NCLaw's four training environments: scenes, and their trajectories as they are observed."""

from functools import cache

from mpm_ref.scene import build
from mpm_ref.trajectories import observed

from ..common.scenes import catalogue_scene, threads_for, with_

ENVIRONMENTS = ("jelly", "sand", "plasticine", "water")


def environment(name, **changes):
    """The scene of a training environment, its fixed step not compared with its bound."""
    return with_(catalogue_scene(f"nclaw_{name}"), unstable="allow", **changes)


@cache
def trajectory(name):
    """`Observed` of the training run of an environment."""
    problem = build(environment(name, every=1))
    with threads_for(problem.bodies):
        return observed(problem)
