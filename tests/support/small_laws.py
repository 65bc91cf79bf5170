"""A small scene whose laws can be learned, a study of it, and laws of its kind, for tests: a cube
of 27 points that is thrown into a corner of NCLaw's box.
"""

from edited_text import write_edited

from mpm_ref.materials import NoFlow, make_law
from mpm_ref.materials.learned.weights import LawWeights, LearnedLaws, save

STEPS, EVERY, DT, DX = 20, 5, 5e-4, 0.05
E, NU = 1e5, 0.2
NO_FLOW = NoFlow()
SCENE = f"""
title = "Cube"
dim = 3
dx = {DX}
dt = {DT}
steps = {STEPS}
every = {EVERY}
gravity = [0.0, -9.8, 0.0]
scheme = {{ transfer = "mls", degree = 2, mass_eps = 1e-7, gravity_on_empty = true }}
walls = {{ low = [3, 3, 3], high = [17, 17, 17], kind = "separate" }}
clip = {{ lower = [0.025, 0.025, 0.025], upper = [0.975, 0.975, 0.975] }}

[[body]]
name = "cube"
density = 1000.0
shape = {{ type = "box", lower = [0.11, 0.11, 0.11], upper = [0.22, 0.22, 0.22] }}
sampling = {{ type = "lattice", counts = [3, 3, 3], faces = true, volume = "shape" }}
velocity = {{ linear = [-1.0, -1.5, -2.0], angular = [4.0, 4.0, 4.0] }}
material = {{ law = "fixed_corotated", E = {E}, nu = {NU} }}
"""
STUDY = """
scene = "cube.toml"
method = "ours"

[train]
epochs = 4
first = 5
last = 10
"""
FLOWING = ('law = "fixed_corotated", E = 100000.0, nu = 0.2',
           'law = "hencky", E = 1e5, nu = 0.2, flow = { type = "von_mises", tau_y = 2e3 }')


def write_scene(folder, *edits, name="cube.toml"):
    """Path of the scene in a folder, with (before, after) of some of its text."""
    return write_edited(folder / name, SCENE, edits)


def write_study(folder, *edits, scene=()):
    """Path of a study in a folder, and beside it the scene, each with edits."""
    write_scene(folder, *scene)
    return write_edited(folder / "cubes.toml", STUDY, edits)


def identified(E=E, name="fixed_corotated", flow=NO_FLOW):
    """`LearnedLaws` without layers: a law of materials, and a flow."""
    return LearnedLaws(LawWeights((), make_law(name, E=E, nu=NU)), LawWeights((), flow), {})


def saved(folder, laws, name="laws.npz"):
    """Path of a file of laws."""
    save(folder / name, laws)
    return folder / name
