"""LDM workshop, Figure 1: the cylinder poked at its rim; ends of full-order (top) and reduced runs
(bottom). A poke is as long as rho, in radii R, and its angles are theta, from the plane y = 0, and
phi, downwards. Colours: distance from the place at rest, where the cylinder shines through.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import Panel, View, body, distance_to, ghost, pictures, shades
from ..common.state_panels import spacing
from ..common.style import shared_scale

NEEDS = ["ldmw.fig1"]


def scale(results):
    own = [r.value for r in results.records(NEEDS[0]) if r.target.endswith(".position")]
    return (f"{shared_scale(results, NEEDS[0], '.position')}; position errors "
            + ", ".join(f"{value:.2g}" for value in own) + " % from left to right")


def draw(results):
    states = read(results.folder, NEEDS[0])
    X, panels = states["X"], []
    paint, shown = shades([1000.0 * distance_to(states[name], X) for name in ("full", "reduced")])
    for name, colours in zip(("full", "reduced"), paint, strict=True):
        for k, (x, colour, mu) in enumerate(zip(states[name], colours, states["mu"], strict=True)):
            panels.append(Panel(body(x, colour, spacing(X)), ghost(X),
                               poked(*mu) if name == "full" else "", "" if k else name))
    count = len(states["mu"])
    return pictures(panels, View(count), shown, "displacement [mm]")


def poked(rho, theta, phi):
    """Return a poke as text: length over the radius, angles in degrees."""
    return rf"$\rho$ = {rho:.1f} R, $\theta$ = {theta:.1f}°, $\phi$ = {phi:.1f}°"
