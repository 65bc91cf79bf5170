"""NSF, Figure 14: bread whose weak elements lie up to 8 % ("mild") and 30 % ("aggressive") of its
width elsewhere: full order, and reduced below each. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.fig14"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], choice=slice(None), turn=0.0, lift=75.0)
