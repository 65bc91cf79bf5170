"""Make the first steps of a scene in a fresh process, and print what of the code they used.

    python -m mpm_ref.needs.code_probe < SCENE.json

The answer is JSON: arrays with their bytes, kernels that Python called, and whether the stress of
each body needs an SVD.
"""

import json
import sys
from types import FunctionType, ModuleType

from .. import explicit
from ..core import deform, jit
from ..core.logarithm import LEAST_STRETCH
from ..scene import build
from ..scene.toml import parse
from ..scene.validate import validate_scene
from ..simulate import simulate

PACKAGE = __package__.partition(".")[0]
STEPS = {"explicit": 70, "implicit": 3}     # past the first sort, checks and stable steps
SVD = "core.spectral.svd"
FALLBACKS = ("core.spectral.rotation", "core.spectral.stretch",     # SVD where strains are large
             "core.deform.deform_radial", "materials.hencky.kirchhoff")
ALWAYS, RARELY, NEVER = "every step", "large strains alone", "never"


class _Enough(Exception):
    """The run has made its first steps."""


def probe(problem):
    """Return the facts of the first steps of a `Problem`, as plain values."""
    made = run_first_steps(problem)
    return {
        "steps": made,
        "arrays": {body.name: particle_arrays(body) for body in problem.bodies},
        "particles": {body.name: len(body.id) for body in problem.bodies},
        "kernels": used_kernels(),
        "svd": {body.name: svd_of(body) for body in problem.bodies},
        "implicit": problem.integrator == "implicit",
        "torch": "torch" in sys.modules,
    }


def run_first_steps(problem):
    """Make the first steps of a run; return their number."""
    most, steps = STEPS[problem.integrator], []

    def count(state, dt):
        steps.append(dt)
        if len(steps) >= most:
            raise _Enough

    try:
        for _ in simulate(problem, on_step=count):
            pass
    except _Enough:
        pass
    return len(steps)


def particle_arrays(body):
    """Return {field: bytes} of a body's particles, 0 where it is not carried or is another one."""
    sizes = {name: array.nbytes for name, array in body.particles._asdict().items()}
    if body.particles.L is body.particles.C:
        sizes["L"] = 0
    return sizes


def used_kernels():
    """Return {kernel: number of its forms} of all kernels that Python called in this process."""
    used = {}
    for name in sorted(sys.modules):
        if name.split(".")[0] != PACKAGE:
            continue
        for value in list(vars(sys.modules[name]).values()):
            forms = getattr(value, "signatures", None)
            if forms and hasattr(value, "py_func"):
                used[name_of(value.py_func)] = len(forms)
    return used


def name_of(function):
    """Return module and name of a function, without the package."""
    return f"{function.__module__.removeprefix(f'{PACKAGE}.')}.{function.__name__}"


# the formulas that a kernel reaches, by the globals that its code names

def svd_of(body):
    """Return when the deformation stage of a body computes an SVD: ALWAYS, RARELY or NEVER."""
    entry, classes = deform_kernel(body), (type(body.law), type(body.flow))
    if entry is deform.radial and body.flow.s_min >= LEAST_STRETCH:
        return ALWAYS
    if SVD in reached(entry, classes, FALLBACKS):
        return ALWAYS
    return RARELY if SVD in reached(entry, classes, ()) else NEVER


def deform_kernel(body):
    """Return the kernel that `explicit.deform_body` calls for a body."""
    calls = []
    names = ("fluid", "elastic", "full", "radial", "plastic")
    recorder = {name: lambda *_, name=name: calls.append(name) for name in names}
    spy = ModuleType("deform")
    vars(spy).update(recorder, is_radial=deform.is_radial)
    explicit.deform, original = spy, explicit.deform
    try:
        explicit.deform_body(body, 0.0)
    finally:
        explicit.deform = original
    return getattr(deform, calls[0])


def reached(entry, classes, stops):
    """Return the names of all formulas that a kernel calls for a law and a flow of given classes,
    itself included; those of `stops` are not entered.
    """
    names, pending = set(), [entry]
    while pending:
        function = python_function(pending.pop(), classes)
        if function is None or name_of(function) in names:
            continue
        if name_of(function) in stops:
            continue
        names.add(name_of(function))
        pending += referred(function)
    return names


def python_function(value, classes):
    """Return the Python function of a kernel, or of the method that a dispatch takes; else None."""
    methods = getattr(value, "methods", None)
    if isinstance(methods, dict):
        value = next((methods[cls] for cls in classes if cls in methods), None)
    value = getattr(value, "py_func", value)
    is_ours = isinstance(value, FunctionType) and value.__module__.startswith(f"{PACKAGE}.")
    return value if is_ours else None


def referred(function):
    """Return the package's objects that the code of a function names."""
    names = [name for code in codes_of(function.__code__) for name in code.co_names]
    values = [function.__globals__[name] for name in names if name in function.__globals__]
    modules = [value for value in values if isinstance(value, ModuleType)]
    return [*values, *(getattr(module, name) for module in modules for name in names
                       if hasattr(module, name))]


def codes_of(code):
    """Yield a code object and those within it."""
    yield code
    for constant in code.co_consts:
        if hasattr(constant, "co_names"):
            yield from codes_of(constant)


if __name__ == "__main__":
    jit.set_threads(1)
    print(json.dumps(probe(build(validate_scene(parse(sys.stdin.read()))))))
