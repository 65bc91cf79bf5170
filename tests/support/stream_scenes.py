"""Scenes with a source of particles, and with a sink below it."""

from mpm_ref.scene import build, loads

DX, SPEED, LENGTH, PER_CELL = 0.05, 1.0, 0.1, 2
SPACING = DX / PER_CELL
WIDTH = 0.1                 # of the stream [m]
TOP = 1.0                   # of the shape [m]


def stream(d=2, source="", keys="end = 0.35", more=""):
    """The text of a scene: a stream of stress-free jelly downwards, from a box between TOP - LENGTH
    and TOP; `source` are further keys of its source, `keys` those of the scene, `more` its tables.
    """
    low, high = [0.5, TOP - LENGTH, 0.5][:d], [0.5 + WIDTH, TOP, 0.5 + WIDTH][:d]
    v = [0.0, -SPEED, 0.0][:d]
    return f"""
dim = {d}
dx = {DX}
{keys}

[[body]]
name = "jet"
density = 1000.0
shape = {{ type = "box", lower = {low}, upper = {high} }}
velocity = {{ linear = {v} }}
material = {{ law = "fixed_corotated", E = 1e4, nu = 0.3 }}
source = {{ {source} }}
{more}
"""


def sink(d=2, height=0.72):
    """The text of a sink that takes everything below a height [m]."""
    return f"""
[[sink]]
shape = {{ type = "half_space", point = {[0.0, height, 0.0][:d]}, normal = {[0, 1, 0][:d]} }}
"""


def gravity(d=2):
    """The text of gravity downwards."""
    return f"gravity = {[0.0, -9.8, 0.0][:d]}"


def problem(*args, **keys):
    """The `Problem` of `stream`."""
    return build(loads(stream(*args, **keys)))
