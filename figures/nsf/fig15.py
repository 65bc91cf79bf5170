"""NSF, Figure 15: bread, training runs with the smallest and the largest modulus."""

from validation.nsf.studies import bread

from ..common.field_panels import RunView, training_range
from ..common.style import shared_scale

NEEDS = ["nsf.bread"]
VIEW = RunView(NEEDS[0], bread, "E = {} Pa", turn=0.0, lift=75.0)


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return training_range(results, VIEW)
