"""LDM, Figure 13: the cylinder before it is poked, when it is let go, and later; full (top) and
reduced (bottom). Colours: distance from the place at rest, where it shines through.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import Panel, View, body, distance_to, ghost, pictures, shades
from ..common.state_panels import spacing
from ..common.style import scales

NEEDS = ["ldm.fig13"]


def scale(results):
    return scales(results, NEEDS[0], "ldm.fig13")


def draw(results):
    states = read(results.folder, NEEDS[0])
    X, panels = states["X"], []
    paint, shown = shades([1000.0 * distance_to(states[name], X) for name in ("full", "reduced")])
    for name, colours in zip(("full", "reduced"), paint, strict=True):
        for x, colour, t in zip(states[name], colours, states["t"], strict=True):
            panels.append(Panel(body(x, colour, spacing(X)), ghost(X), f"{name}, t = {t:.2f} s"))
    return pictures(panels, View(3, width=5.4), shown, "displacement [mm]")
