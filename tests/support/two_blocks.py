"""A soft block with a hard one on it or over it, of other density, on a floor that holds the soft
one: a scene of two elastic bodies in one velocity field, and a study of it.
"""

from edited_text import write_edited

STEPS = 8
SCENE = f"""
title = "Two blocks"
dim = 2
dx = 0.1
dt = 0.002
steps = {STEPS}
gravity = [0.0, -9.8]
scheme = {{ transfer = "pic" }}

[[body]]
name = "soft"
density = 1000.0
shape = {{ type = "box", lower = [0.0, 0.0], upper = [0.6, 0.2] }}
sampling = {{ type = "regular", per_cell = 2 }}
material = {{ law = "fixed_corotated", E = 1.0e5, nu = 0.3 }}

[[body]]
name = "hard"
density = 3000.0
shape = {{ type = "box", lower = [0.1, 0.2], upper = [0.5, 0.4] }}
sampling = {{ type = "regular", per_cell = 2 }}
velocity = {{ linear = [1.0, -1.0] }}
material = {{ law = "fixed_corotated", E = 1.0e6, nu = 0.2 }}

[[fixed]]
name = "floor"
region = {{ type = "half_space", point = [0.0, 0.05], normal = [0.0, 1.0] }}
"""
STUDY = """
title = "Blocks"
scene = "blocks.toml"
test = 1

[[parameter]]
name = "v"
key = "body.hard.velocity.linear[0]"
from = 0.5
to = 2.0
count = 4

[map]
kind = "modes"
r = 6
"""


def write(folder, *edits, scene=SCENE):
    """Path of the study in a folder, with (before, after) of some of its text."""
    (folder / "blocks.toml").write_text(scene)
    return write_edited(folder / "study.toml", STUDY, edits)
