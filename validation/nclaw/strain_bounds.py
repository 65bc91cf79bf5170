"""The strains that the trained laws of the experiments have met: as their weights say, else as
their training, made again as far as it needs to be, shows.
"""

from functools import cache

from mpm_ref.nclaw.bodies import body_maker
from mpm_ref.nclaw.train.recipe import Recipe
from mpm_ref.nclaw.train.strains import segment_cuts, training_bounds
from mpm_ref.scene import build

from ..common.scenes import threads_for
from .environments import environment, trajectory
from .trained_laws import nets, trained

LABELED = "labeled"     # the method that runs no segments


@cache
def met_by(name):
    """Bounds (see `learned.strain_range`) of the laws of `nets` by name; errors as of `trained`."""
    laws = trained(name)
    return laws.about["seen"] if "seen" in laws.about else bounds(nets()[name], laws)


def bounds(net, laws):
    """Bounds of the strains that laws have met, which were trained as a `Net` says."""
    observed, problem = trajectory(net.environment), build(environment(net.environment))
    steps = len(observed.x) - 1
    cuts = () if net.method == LABELED else segment_cuts(Recipe(epochs=net.epochs), steps)
    with threads_for(problem.bodies):
        return training_bounds(problem, observed, body_maker(laws), cuts)
