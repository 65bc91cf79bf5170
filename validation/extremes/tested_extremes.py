"""The extremes that tests hold already: where each of them is."""

import ast

from ..common.registry import experiment
from ..common.results import ROOT

# What, and the test file with a word that names of tests in it must contain.
HELD = (
    ("affine fields are reproduced by G2P after P2G", "core/test_transfer", "affine"),
    ("partition of unity, gradients that sum to zero, at cell faces", "core/test_spline", "unity"),
    ("the SPD-projected differential", "materials/test_materials", "projected"),
    ("Taylor tests of energy, force and differential", "materials/test_materials", "derivative"),
    ("the same bits for any number of threads and layer", "core/test_determinism", "threads"),
    ("the same bits across a restart", "store/test_resume", "bit"),
    ("singular values that coincide, vanish or overflow", "core/test_spectral", "svd"),
    ("laws at degenerate deformation", "materials/test_material_extremes", ""),
    ("hostile scenes end in one line", "scene/test_errors", ""),
    ("kill, full disk, damaged files", "store/test_journal", ""),
)


@experiment("extremes.explicit.elsewhere", title="Extremes that the tests hold",
            profiles=("quick", "standard"), budget={"quick": 0.1, "standard": 0.1})
def elsewhere(run):
    """A pointer to each; they pass or fail with `make test`, not here."""
    for what, file, word in HELD:
        found = tests_of(file, word)
        run.record(f"extremes.explicit.elsewhere.{file}{'.' + word if word else ''}", len(found),
                   unit="tests", comparator="info", scale="run by `make test`",
                   note=f"{what}: tests/{file}.py, {', '.join(found[:3]) or 'none'}")


def tests_of(file, word):
    """Names of the test functions of a file that contain a word."""
    path = ROOT / "tests" / f"{file}.py"
    if not path.exists():
        return []
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node.name for node in tree.body if isinstance(node, ast.FunctionDef)
            and node.name.startswith("test_") and word in node.name]
