"""NSF, Figure 14: bread whose weak elements lie up to 8 % ("mild") and 30 % ("aggressive") of its
width elsewhere: full order, and reduced below each.
"""

from validation.nsf.studies import bread

from ..common.field_panels import RunView, reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.fig14"]
VIEW = RunView(NEEDS[0], bread, "{}", turn=0.0, lift=75.0)


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, VIEW, choice=slice(None))
