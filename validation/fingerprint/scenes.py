"""Every shipped scene, and explicit schemes, laws and return maps that no shipped scene has."""

from functools import partial

from .library import problem, scene_names, simulated
from .recording import Case

STEPS = 300
COSTLY = {      # steps of scenes whose steps take long
    "hot_aluminium": 3, "hot_armacat": 4, "hot_boards": 4, "hot_boxes": 20, "hot_chain": 4,
    "hot_donut": 8, "hot_faceless": 10, "hot_sauce": 12, "hot_stiffness": 8, "hot_twist": 4,
    "hot_wheel": 10, "ldm_gravity": 200, "ldm_poke": 200, "ldm_torsion": 200, "ldm_tower": 20,
    "nclaw_jelly": 200, "nclaw_plasticine": 200, "nclaw_sand": 200, "nclaw_water": 200,
    "nsf_ball": 8, "nsf_bread": 15, "nsf_cake": 5, "nsf_jelly": 60, "nsf_metal": 15,
    "nsf_sand": 10, "nsf_toothpaste": 15,
}
SCHEMES = {"pic-1": {"transfer": "pic", "degree": 1}, "flip-3": {"transfer": "flip", "degree": 3},
           "apic-3": {"transfer": "apic", "degree": 3}}
MATERIALS = {
    "neo-hookean": {"law": "neo_hookean", "E": 1e5, "nu": 0.3},
    "log-neo-hookean": {"law": "log_neo_hookean", "E": 1e5, "nu": 0.3},
    "fluid projection": {"law": "fluid", "E": 1e5, "nu": 0.3,
                         "flow": {"type": "fluid_projection"}},
}
OTHERS = 100        # steps of these


def cases():
    """Return a `Case` of each shipped scene, and of `hello` with other schemes and materials."""
    found = [Case(f"scene {name}", partial(run, name, STEPS)) for name in scene_names()]
    for name, keys in SCHEMES.items():
        values = {f"scheme.{key}": value for key, value in keys.items()}
        found.append(Case(f"scheme {name}", partial(run, "hello", OTHERS, values)))
    for name, material in MATERIALS.items():
        values = {"body[0].material": material}
        found.append(Case(f"material {name}", partial(run, "hello", OTHERS, values)))
    return found


def run(name, steps, values=None):
    """Return what a scene ends with after some steps, fewer where they are costly."""
    return simulated(problem(name, values), COSTLY.get(name, steps))
