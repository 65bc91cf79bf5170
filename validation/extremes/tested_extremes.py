"""Extremes that the tests cover, with the place of each."""

import ast

from ..common.registry import experiment
from ..common.results import ROOT

# Extreme, test file, and a word that the names of its tests contain.
TESTED = (
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


@experiment("extremes.explicit.elsewhere", title="Extremes that the tests cover",
            profiles=("quick", "standard"), budget={"quick": 0.1, "standard": 0.1})
def tested_extremes(run):
    """Record where each is tested; `make test` decides whether it passes."""
    for what, file, word in TESTED:
        names = tests_of(file, word)
        run.record(f"extremes.explicit.elsewhere.{file}{'.' + word if word else ''}", len(names),
                   unit="tests", comparator="info", scale="run by `make test`",
                   note=f"{what}: tests/{file}.py, {', '.join(names[:3]) or 'none'}")


def tests_of(file, word):
    """Return the names of a file's test functions that contain a word."""
    path = ROOT / "tests" / f"{file}.py"
    if not path.exists():
        return []
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node.name for node in tree.body if isinstance(node, ast.FunctionDef)
            and node.name.startswith("test_") and word in node.name]
