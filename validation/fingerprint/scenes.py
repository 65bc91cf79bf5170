"""Runs of every scene, and of explicit schemes, laws and return maps that no scene has."""

from functools import partial

from .library import problem, scene_names, simulated
from .recording import RunCase

STEPS = 400
OTHER_STEPS = {     # of scenes whose steps take long, or that collide late
    "colliding_disks": 2000, "hello": 1200, "hot_aluminium": 3, "hot_armacat": 4, "hot_boards": 4,
    "hot_boxes": 20, "hot_chain": 4, "hot_donut": 8, "hot_faceless": 10, "hot_sauce": 12,
    "hot_stiffness": 8, "hot_twist": 4, "hot_wheel": 10, "ldm_tower": 40, "nsf_ball": 20,
    "nsf_bread": 40, "nsf_cake": 10, "nsf_jelly": 100, "nsf_metal": 40, "nsf_sand": 25,
    "nsf_toothpaste": 40,
}
SCHEMES = {"pic-1": {"transfer": "pic", "degree": 1}, "flip-3": {"transfer": "flip", "degree": 3},
           "apic-3": {"transfer": "apic", "degree": 3}}
MATERIALS = {
    "neo-hookean": {"law": "neo_hookean", "E": 1e5, "nu": 0.3},
    "log-neo-hookean": {"law": "log_neo_hookean", "E": 1e5, "nu": 0.3},
    "fluid projection": {"law": "fluid", "E": 1e5, "nu": 0.3,
                         "flow": {"type": "fluid_projection"}},
}
OTHERS = 100        # steps of runs of `hello` with other schemes and materials


def cases():
    """Return a `RunCase` of each scene, and of `hello` with other schemes and materials."""
    runs = [RunCase(f"scene {name}", partial(run, name, OTHER_STEPS.get(name, STEPS)))
             for name in scene_names()]
    for name, keys in SCHEMES.items():
        values = {f"scheme.{key}": value for key, value in keys.items()}
        runs.append(RunCase(f"scheme {name}", partial(run, "hello", OTHERS, values)))
    for name, material in MATERIALS.items():
        values = {"body[0].material": material}
        runs.append(RunCase(f"material {name}", partial(run, "hello", OTHERS, values)))
    return runs


def run(name, steps, values=None):
    """Return the state after some steps of a scene with other values."""
    return simulated(problem(name, values), steps)
