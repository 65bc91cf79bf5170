"""The import direction: a file imports only from floors below its own (docs: the house plan)."""

import ast
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Ground floor first. What stands on one line does not know each other, except within a room: names
# in one string may import each other, without cycles. A package in PACKAGES is such a room.
PACKAGES = {"plain", "materials", "materials.learned", "hot", "rom", "rom.study", "nclaw",
            "nclaw.study", "shapes", "sampling", "scene", "oracle", "cli", "executor", "sweep",
            "trade", "limits", "needs"}
FLOORS = (
    ("core.kernel_cache", "core.precision", "core.blas", "core.lanes", "core.prefetch",
     "core.heap"),
    ("core.jit",),
    ("core.tensor", "core.gimp", "core.block_table", "core.packing"),
    ("core.mls_slopes",),
    ("core.law", "core.spectral core.deflation core.scaling", "core.logarithm", "core.spline",
     "core.solids"),
    ("core.stencil", "core.state", "core.lines", "core.islands"),
    ("core.order", "core.adjoint.shape_gradient"),
    ("core.grid", "core.deform", "core.corotated", "core.levelset",
     "core.transfer core.transfer_lines core.transfer_mls3 core.relaxation"),
    ("core.motion", "core.contact", "core.displacement", "core.f_bar", "core.sparse_grid",
     "core.adjoint.transfer core.adjoint.transfer_lines core.adjoint.transfer_mls3 "
     "core.adjoint.moments core.adjoint.records core.adjoint.slopes",
     "core.adjoint.grid", "core.adjoint.deform core.adjoint.corotated core.adjoint.strain "
     "core.adjoint.blocks core.adjoint.block_steps"),
    ("core.mass_nodes", "core.adjoint.full"),
    ("core.boundary",),
    ("core.adjoint.boundary", "core.surface", "core.body_contact core.crowded_nodes"),
    ("core core.adjoint",),
    ("materials", "plain", "store.atomic"),
    ("body", "store.atomic", "store.weights_file", "store.memmap"),
    ("training",),
    ("materials.learned",),
    ("explicit", "energy"),
    ("timestep", "monitor", "adjoint", "constitutive", "energy_budget", "body_contact"),
    ("tape", "streams"),
    ("hot", "rom", "nclaw"),
    ("problem", "shapes", "attempt"),
    ("simulate", "sampling", "preflight"),
    ("indicators",),
    ("scene",),
    ("store store.*",),     # but for its modules on lower floors
    ("executor",),
    ("oracle", "sweep", "plotting", "trajectories"),
    ("rom.study",),
    ("nclaw.study",),
    ("trade", "limits", "needs"),
    ("cli",),
    ("__main__",),
)
OUTSIDE = {"validation", "figures", "benchmarks", "tests"}      # floor 9 and what tests it
TRAINING = ("rom.train", "nclaw.train", "nclaw.gnn.train", "training")   # files that know torch
LATE = {"torch", "matplotlib", "vtk", "trimesh", "taichi", "warp", "PIL",
        "dask", "distributed"}      # also in functions


def modules(root, package):
    """{module name without the package: (syntax tree, whether it is a package)}."""
    found = {}
    for file in sorted((root / package).rglob("*.py")):
        parts = file.relative_to(root / package).with_suffix("").parts
        name = ".".join(p for p in parts if p != "__init__")
        found[name] = ast.parse(file.read_text(encoding="utf-8")), file.name == "__init__.py"
    return found


def absolute(node, name, is_package, package):
    """Absolute dotted names imported by an import statement of module `name` of `package`."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    base = node.module or ""
    if node.level:
        here = [package, *filter(None, name.split("."))]
        up = here[:len(here) - node.level + is_package]
        base = ".".join([*up, *filter(None, [base])])
    return [f"{base}.{alias.name}" for alias in node.names]


def imports(package_modules, package):
    """(importing module, absolute imported name, whether inside a function), for each import."""
    for name, (tree, is_package) in package_modules.items():
        inner = {id(node) for outer in ast.walk(tree)
                 if isinstance(outer, ast.FunctionDef | ast.AsyncFunctionDef)
                 for node in ast.walk(outer)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                for target in absolute(node, name, is_package, package):
                    yield name, target, id(node) in inner


def own(target, package_modules, package):
    """The module of the package that an imported name belongs to, or None."""
    if target.split(".")[0] != package:
        return None
    parts = target.split(".")[1:]
    while parts and ".".join(parts) not in package_modules:
        parts.pop()
    return ".".join(parts)


def floor(name):
    """(floor, room on that floor) of a module, or None."""
    parts = name.split(".")
    rooms = (".".join(parts[:k]) for k in range(len(parts), 0, -1))
    entry = next((room for room in rooms if room in PACKAGES), name)
    return next(((k, room) for k, rooms in enumerate(FLOORS) for room in rooms
                 if any(fnmatchcase(entry, pattern) for pattern in room.split())), None)


def violations(root, package="mpm_ref"):
    """Every import that goes up, sideways, out of the house, or hides in a function."""
    tree = modules(root, package)
    for name, target, inside in imports(tree, package):
        top = target.split(".")[0]
        if top in OUTSIDE:
            yield f"{name} imports {top}, which stands above the package"
        if top == "torch" and not name.startswith(TRAINING):
            yield f"{name} imports torch; only {' and '.join(TRAINING)} may"
        if inside and top not in LATE:
            yield f"{name} imports {target} inside a function; only {sorted(LATE)} may be late"
        below = own(target, tree, package)
        if below and name and not allowed(name, below):
            yield f"{name} imports {below}, which is not below it"


def allowed(name, below):
    """Whether module `name` may import module `below`."""
    here, there = floor(name), floor(below)
    if here is None or there is None:
        return False
    return there[0] < here[0] or here == there


def cycle(graph):
    """One cycle of a graph {node: nodes} as a list of nodes, or None."""
    done, path = set(), []

    def visit(node):
        if node in path:
            return [*path[path.index(node):], node]
        if node in done:
            return None
        path.append(node)
        found = next(filter(None, map(visit, sorted(graph.get(node, ())))), None)
        path.pop()
        done.add(node)
        return found

    return next(filter(None, map(visit, sorted(graph))), None)


def graph_of(root, package):
    tree = modules(root, package)
    graph = {name: set() for name in tree}
    for name, target, _ in imports(tree, package):
        other = own(target, tree, package)
        if other is not None and other != name:
            graph[name].add(other)
    return graph


def test_every_module_has_a_floor():
    homeless = [name for name in modules(ROOT, "mpm_ref") if name and floor(name) is None]
    assert not homeless, f"give these modules a floor in FLOORS: {homeless}"


def test_imports_go_down():
    found = sorted(set(violations(ROOT)))
    assert not found, "\n".join(found)


@pytest.mark.parametrize("package", ["mpm_ref", "validation", "figures"])
def test_no_cycle(package):
    found = cycle(graph_of(ROOT, package))
    assert not found, " -> ".join(found)


@pytest.mark.parametrize("package", ["validation", "figures"])
def test_suite_imports_late_only_what_is_optional(package):
    tree = modules(ROOT, package)
    found = [f"{name}: {target}" for name, target, inside in imports(tree, package)
             if inside and target.split(".")[0] not in LATE]
    assert not found, "\n".join(found)


# The check itself, on packages that break one rule each.

def toy(tmp_path, **files):
    for name, text in {"__init__": "", "core/__init__": "", **files}.items():
        file = tmp_path / "mpm_ref" / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return tmp_path


@pytest.mark.parametrize(("files", "said"), [
    ({"core/jit": "from ..explicit import step", "explicit": ""}, "core.jit imports explicit"),
    ({"core/jit": "from . import tensor", "core/tensor": ""}, "core.jit imports core.tensor"),
    ({"core/spline": "from .spectral import svd", "core/spectral": ""}, "core.spline imports"),
    ({"hot": "import mpm_ref.rom", "rom": ""}, "hot imports rom"),
    ({"hot": "from . import rom", "rom": ""}, "hot imports rom"),
    ({"hot/__init__": "from ..rom import x", "rom": ""}, "hot imports rom"),
    ({"hot/newton": "from ..rom import x", "rom": ""}, "hot.newton imports rom"),
    ({"problem": "from . import simulate", "simulate": ""}, "problem imports simulate"),
    ({"core/spline": "from .scaling import x", "core/scaling": ""}, "core.spline imports"),
    ({"explicit": "import torch"}, "explicit imports torch"),
    ({"explicit": "import validation.common.run"}, "explicit imports validation"),
    ({"explicit": "def f():\n    import scipy.sparse"}, "inside a function"),
    ({"materials/a": "from ..unheard import x", "unheard": ""}, "materials.a imports unheard"),
    ({"explicit": "from .core.new import x", "core/new": ""}, "explicit imports core.new"),
])
def test_violation_is_found(tmp_path, files, said):
    found = list(violations(toy(tmp_path, **files)))
    assert len(found) == 1
    assert said in found[0]


@pytest.mark.parametrize("files", [
    {"core/tensor": "from .jit import kernel", "core/jit": "import numba"},
    {"explicit": "from .core.tensor import det\nfrom .materials import Material",
     "core/tensor": "", "materials/__init__": "from .sand import Sand", "materials/sand": ""},
    {"rom/train": "import torch", "cli": "def plot():\n    import matplotlib.pyplot"},
    {"scene": "from mpm_ref import __version__"},
    {"core/spectral": "from .scaling import is_finite", "core/scaling": ""},
])
def test_what_is_allowed_passes(tmp_path, files):
    assert list(violations(toy(tmp_path, **files))) == []


def test_cycle_is_found(tmp_path):
    root = toy(tmp_path, **{"hot/__init__": "", "hot/newton": "from . import lbfgs",
                            "hot/lbfgs": "from .newton import step"})
    assert cycle(graph_of(root, "mpm_ref")) == ["hot.lbfgs", "hot.newton", "hot.lbfgs"]
