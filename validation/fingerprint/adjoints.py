"""Gradients of a loss of short explicit runs, of each kind of material, in 2D and 3D."""

from functools import partial

from .library import adjoint_of, problem
from .recording import RunCase

SCENES = {          # name: (scene, steps, dt [s])
    "elastic 2D": ("hello", 20, 5e-4),
    "elastic 2D APIC": ("hello", 20, 5e-4, {"scheme": {"transfer": "apic", "degree": 2}}),
    "elastic 3D": ("nclaw_jelly", 10, 5e-4),
    "von Mises 3D": ("nclaw_plasticine", 10, 5e-4),
    "sand 2D": ("column_collapse", 10, 1e-5),
    "sand 3D": ("nclaw_sand", 10, 5e-4),
    "fluid 2D": ("dam_break", 10, 5e-5),
    "fluid 3D": ("nclaw_water", 10, 5e-4),
    "hardening 3D": ("nsf_metal", 5, 3e-3, {"dx": 0.02, "dt": 3e-3}),
}


def cases():
    """Return a `RunCase` of each scene."""
    return [RunCase(f"adjoint {name}", partial(run, *arguments))
            for name, arguments in SCENES.items()]


def run(name, steps, dt, values=None):
    """Return the state and the gradients of a scene's run."""
    return adjoint_of(problem(name, values), steps, dt)
