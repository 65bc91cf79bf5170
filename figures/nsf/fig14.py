"""NSF, Figure 14: bread whose weak elements lie up to 8 % ("mild") and 30 % ("aggressive") of its
width elsewhere: full order, and reduced below each. From left to right: time.
"""

from ..common.field_panels import reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.fig14"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, NEEDS[0], choice=slice(None), turn=0.0, lift=75.0)
