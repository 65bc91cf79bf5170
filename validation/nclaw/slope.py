"""NCLaw's task (d), an inclined plane (Figure 2d): true laws, ours, and those that thermodynamics
admits. The paper's is of water, and only looked at.
"""

from functools import partial

from mpm_ref.scene import Poisson

from ..common.registry import experiment
from ..common.scenes import with_
from .environments import ENVIRONMENTS, environment
from .other_bodies import both, show
from .stand_in_bodies import said
from .tasks import slope

WORDS = ("ours", "admissible")
FEW, SHORT = 1000, 550          # points and steps, quick: until it has reached the floor


@experiment("nclaw.slope", title="NCLaw: an inclined plane, task (d)",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 2400})
def inclined(run):
    """Keeps points at the start and at the end, of water, and of the other materials in its place;
    all as dense.
    """
    names = run.choose(quick=("water",), standard=ENVIRONMENTS)
    show(run, {name: (partial(both, sized(run, slope_of(name)), WORDS), said("dragon"))
               for name in names})


def slope_of(name):
    """The scene of task (d) with an environment's material."""
    scene, material = slope(), environment(name).body[0].material
    return with_(scene, body=(with_(scene.body[0], name=name, material=material),))


def sized(run, scene):
    """A scene, at quick of few points and steps."""
    few = with_(scene.body[0], sampling=Poisson(count=FEW))
    return run.choose(quick=with_(scene, steps=SHORT, body=(few,)), standard=scene)
