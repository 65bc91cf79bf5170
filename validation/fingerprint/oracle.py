"""Golden files of explicit and implicit steps and of an adjoint, with the errors stored in them.

They hold every stage of a step by the plain twin in extended precision.
"""

from functools import partial

from .implicit import METHODS, SETUPS
from .library import problem, solvers, with_solver
from .library_oracle import golden
from .recording import RunCase

EXPLICIT = {"explicit 2D": ("hello", {}), "explicit plastic 3D": ("nclaw_plasticine", {
    "body[0].sampling.counts": [4, 4, 4]}), "explicit fluid": ("dam_break", {"dx": 0.01143})}
ADJOINT = {"adjoint 2D": ("hello", {"body[0].sampling.per_cell": 2}),   # with 3, particles lie on
           "adjoint plastic 3D": EXPLICIT["explicit plastic 3D"]}       # faces of cells: a kink


def cases():
    """Return a `RunCase` of each kind of golden file."""
    runs = [RunCase(f"oracle {name}", partial(of_scene, "steps", *arguments))
             for name, arguments in EXPLICIT.items()]
    runs += [RunCase(f"oracle {name}", partial(of_scene, "adjoint", *arguments))
              for name, arguments in ADJOINT.items()]
    return [*runs, RunCase("oracle implicit", implicit)]


def of_scene(kind, name, values):
    """Return the golden file of a scene's first steps."""
    return golden(kind, problem(name, values), 2)


def implicit():
    """Return the golden file of an implicit step of the small disk by HOT."""
    name, values = SETUPS["disk"]
    options = dict(zip(METHODS, solvers(), strict=True))["hot"]
    return golden("steps", with_solver(problem(name, values), options), 1)
