"""NSF, Figure 5: bread is torn: the full-order run, the reduced one with fields of stress, and the
one that knows the map alone.
"""

from validation.nsf.studies import bread

from ..common.field_panels import RunView, reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.bread"]
VIEW = RunView(NEEDS[0], bread, "E = {} Pa", turn=0.0, lift=75.0)


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, VIEW, ("true", "ours", "map"))
