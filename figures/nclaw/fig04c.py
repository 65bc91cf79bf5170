"""NCLaw, Figure 4 (c) and (d): dough, on synthetic observations: the block that was filmed, and a
star, half-way and at the end; from left to right the start, the truth, ours, laws that
thermodynamics admits, the wrong guess that ours begin with. Colours: distance from the truth.
"""

import numpy as np
from matplotlib.colors import to_rgb

from validation.ldm.published_bodies import read
from validation.nclaw.dough import block, scene

from ..common.bodies import (
    GHOST,
    Panel,
    View,
    distance_to,
    failure_note,
    no_balls,
    pictures,
    shades,
)
from ..common.law_panels import available
from ..common.state_panels import cloud, spacing
from ..common.style import scales

NEEDS = ["nclaw.dough"]
BODIES = {"block": "(c) block", "star": "(d) star"}
WORDS = {"true": "truth", "dough": "ours", "dough-admissible": "admissible", "guess": "guess"}
SHARES = {1: 0.5, 2: 1.0}       # of a run at its stored times
TOP = 20.0          # end of the colours [mm]


def scale(results):
    block, star = (scales(results, NEEDS[0], part) for part in ("depth_speed", ".star"))
    return f"block: {block}; star: {star}"


def draw(results):
    states, panels, filmed = read(results.folder, NEEDS[0]), [], scene(block())
    words = available(states, BODIES, WORDS)
    shown = shades(np.zeros(1), top=TOP)[1]
    end = filmed.steps * filmed.dt
    for body, label in BODIES.items():
        for k, share in SHARES.items():
            title = "" if panels else "start"
            start = body_panel(states, (body, "true", 0), title)
            panels.append(start._replace(side=f"{label}\nt = {share * end:.2g} s"))
            for word in words:
                title = "" if panels[1 + len(words):] else WORDS[word]
                panels.append(body_panel(states, (body, word, k), title))
    columns = 1 + len(words)
    return pictures(panels, View(columns, 12.0, 10.0), shown,
                    "distance from the truth [mm]")


def body_panel(states, which, title):
    """Return the panel of a body with a law at a stored time, which = (body, law, number of the
    time); grey at the start.
    """
    body, word, k = which
    x, true = (states[f"{body}_{of}"].astype(float) for of in (word, "true"))
    if not np.isfinite(x[k]).all():
        return Panel(no_balls(), no_balls(), title,
                     note=failure_note(x[k], np.isfinite(x[k]).all(axis=1)))
    paint = shades(1e3 * distance_to(x[k], true[k]), top=TOP)[0]
    if k == 0:
        paint[:] = to_rgb(GHOST)
    return Panel(cloud(x[k], np.zeros(len(x[k])), paint, spacing(true[0])), no_balls(), title)
