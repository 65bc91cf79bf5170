"""LDM, Figure 6: the cylinder under three gravities, at the end of reduced runs; at rest, it shines
through. Colours: distance from the place at rest.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import Panel, View, body, distance_to, ghost, pictures, shades
from ..common.state_panels import spacing
from ..common.style import scales

NEEDS = ["ldm.fig6"]


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    states = read(results.folder, NEEDS[0])
    X, x = states["X"], states["reduced"]
    paint, shown = shades(1000.0 * distance_to(x, X))
    panels = [Panel(body(x[k], paint[k], spacing(X)), ghost(X), f"g = {g:g} m/s²")
              for k, g in enumerate(states["g"])]
    return pictures(panels, View(3), shown, "displacement [mm]")
