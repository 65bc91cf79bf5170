"""NCLaw, Figure 6: the training runs of jelly, sand, plasticine and water (from top to bottom).
Colours: height at the start.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import Panel, View, nothing, pictures
from ..common.orders import shared
from ..common.pairs import dyed

NEEDS = ["nclaw.fig6"]
NAMES = ("jelly", "sand", "plasticine", "water")
VIEW = View(5, 10.0)


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    kept, found = read(results.folder, NEEDS[0]), []
    for name in NAMES:
        x = kept[name].astype(float)
        for k, t in enumerate(kept["t"]):
            found.append(Panel(dyed(x[k], x[0]), nothing(), "" if found[4:] else f"t = {t:.3g} s",
                               "" if k else name))
    return pictures(found, VIEW)
