"""NCLaw, Figure 6: the training runs of jelly, sand, plasticine and water (from top to bottom)."""

from validation.ldm.published_bodies import read

from ..common.bodies import Panel, View, no_balls
from ..common.law_panels import colour_by_height, pictures_by_height
from ..common.style import shared_scale

NEEDS = ["nclaw.fig6"]
NAMES = ("jelly", "sand", "plasticine", "water")
VIEW = View(5)


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    states, panels = read(results.folder, NEEDS[0]), []
    for name in NAMES:
        x = states[name].astype(float)
        for k, t in enumerate(states["t"]):
            title = "" if panels[4:] else f"t = {t:.3g} s"
            panels.append(Panel(colour_by_height(x[k], x[0]), no_balls(), title,
                               "" if k else name))
    return pictures_by_height(panels, VIEW)
