"""Check steps of Taichi and Warp, and gradients of Warp's tape, against golden files by stages.

A golden file of each case is recorded here. A backend gets the initial state and the constants that
are in the file, makes the steps in a process of its own, and its arrays are compared by the rule of
`mpm_ref.oracle`, whose tolerances are those of the precision of the backend. No tolerance is
changed. Where a body departs, its steps are made again with the singular value decomposition of
NumPy in double precision in place of the library's: a departure that this removes is the library's.
What still departs is checked once more without nodes that have hardly any mass.
"""

from dataclasses import asdict
from importlib.metadata import version
from importlib.util import find_spec
from tempfile import TemporaryDirectory

import h5py
import numpy as np

from mpm_ref import oracle
from mpm_ref.oracle.comparison import compare_array, given_arrays, golden_arrays
from mpm_ref.oracle.schema import stage_arrays

from .backends import RemoteBackend
from .conformance_cases import (
    ADJOINT_CASES,
    CASES,
    STEPS,
    case_problem,
    double_svd,
    read_seeds,
    read_start,
)

PRECISIONS = ("f64", "f32")
MASS_FLOOR = 1e-13      # of the heaviest node, below which a node is left out
CHECKS = ("library", ()), ("double", ("svd",)), ("double", ("svd", "nodes"))
FLUID_CHECKS = ("library", ()), ("library", ("nodes",))     # a fluid has no decomposition
PACKAGES = {"taichi": "taichi", "warp": "warp-lang"}


def require_installed(names):
    """Raise ValueError for a backend that is unknown or not installed."""
    for name in names:
        if name not in PACKAGES:
            raise ValueError(f"--backends {name}: unknown; expected some of {', '.join(PACKAGES)}")
        if find_spec(name) is None:
            raise ValueError(f"--backends {name}: it is not installed; "
                             "pip install -c constraints.txt -e '.[bench]'")


def versions(names):
    """Return {package: version} of the backends and of NumPy."""
    return {package: version(package) for package in (*map(PACKAGES.get, names), "numpy")}


def serve_stages(pipe, name, precision, threads):
    """Answer tasks of the pipe until one is None: (`Start`, svd) with the stages of the steps and
    the rotations of each, (list of (`Start`, seed), svd) with the gradients of each step.
    """
    if name == "taichi":
        from .taichi_stages import TaichiStages as Stages
    else:
        from .warp_adjoint import pull_back
        from .warp_stages import WarpStages as Stages
    while (task := pipe.recv()) is not None:
        first, svd = task
        if isinstance(first, list):
            pipe.send([pull_back(start, seed, precision, svd) for start, seed in first])
        else:
            steps = Stages(first, precision, svd)
            pipe.send([(steps.step(), steps.rotations()) for _ in range(STEPS)])


def conformance_rows(names, cases=CASES, adjoint_cases=ADJOINT_CASES):
    """Yield a row for every check of the cases by the backends, and of gradients by Warp's."""
    with TemporaryDirectory() as folder:
        goldens = {case: record_case(case, f"{folder}/{k}.h5") for k, case in enumerate(cases)}
        adjoints = {case: record_case(case, f"{folder}/adjoint{k}.h5", oracle.record_adjoint)
                    for k, case in enumerate(adjoint_cases if "warp" in names else ())}
        for name in names:
            for precision in PRECISIONS:
                backend = RemoteBackend(name, precision, 1, serve_stages)
                try:
                    for case, golden in goldens.items():
                        yield from step_rows(case, golden, (name, precision), backend)
                    for case, golden in adjoints.items() if name == "warp" else ():
                        yield from adjoint_rows(case, golden, (name, precision), backend)
                finally:
                    backend.close()


def record_case(case, path, record=oracle.record):
    """Record the steps of a case in a golden file and return its path; `oracle.record_adjoint`
    records their adjoint as well.
    """
    problem, begin = case_problem(case)
    record(problem, path, STEPS, begin=begin)
    return path


def step_rows(case, golden, name_and_precision, backend):
    """Yield the row of a case, and while it departs those of the steps with `double_svd`, and of
    the same without nodes that are lighter than `MASS_FLOOR`.
    """
    start, is_fluid = read_start(golden), case.material == "fluid"
    answers = {}
    for svd, replaced in FLUID_CHECKS if is_fluid else CHECKS:
        if svd not in answers:
            answers[svd] = backend.run((start, svd))
        steps = [stages for stages, _ in answers[svd]]
        if "nodes" in replaced:
            steps = [without_light_nodes(stages) for stages in steps]
        row = labels(case, name_and_precision, "none" if is_fluid else svd) | {
            "kind": "steps", "replaced": list(replaced),
            **checked_row(golden, steps, name_and_precision[1])}
        yield row if is_fluid else row | {"rotations": rotation_errors(answers[svd])}
        if row["agrees"]:
            break


def without_light_nodes(stages):
    """Return stages in which nodes lighter than `MASS_FLOOR` of the heaviest have no mass, so that
    `oracle.write` leaves them out.

    Points of a lattice may lie half-way between two nodes; then a node gets the square of round-off
    for its weight, and single precision does not determine its velocity.
    """
    m = stages["mass"]
    return stages | {"mass": np.where(m > MASS_FLOOR * m.max(), m, 0.0)}


def adjoint_rows(case, golden, name_and_precision, backend):
    """Yield the rows of a case's gradients: with the rotation of a jelly by Newton's iteration, and
    by the library's singular value decomposition.
    """
    tasks = list(zip(*read_seeds(golden), strict=True))
    for svd in ("library", "newton") if case.material == "jelly" else ("none",):
        gradients = backend.run((tasks, svd))
        yield labels(case, name_and_precision, svd) | {
            "kind": "adjoint", "replaced": ["svd"] if svd == "newton" else [],
            **checked_row(golden, gradients, name_and_precision[1])}


def labels(case, name_and_precision, svd):
    """Return what a row is of."""
    name, precision = name_and_precision
    return {"case": str(case), "backend": name, "precision": precision, "svd": svd}


def checked_row(golden, steps, precision):
    """Return the part of a row that the oracle says of the arrays of a backend's steps."""
    with TemporaryDirectory() as folder:
        other = f"{folder}/other.h5"
        oracle.write(other, steps)
        report = oracle.check(golden, other, precision)
        first = None if report.first is None else asdict(report.first)
        return {"agrees": report.agrees, "arrays": report.compared,
                "departures": len(report.departures), "missing": list(report.missing),
                "first": first, "exact": exact_arrays(golden),
                "stages": stage_errors(golden, other, precision)}


def exact_arrays(golden):
    """Return the names of the arrays of a golden file that have entries with a tolerance of 0."""
    with h5py.File(golden) as g:
        return sorted({name for step in g["steps"].values()
                       for array, name in golden_arrays(step, stage_arrays("explicit"), ["body"])
                       if (tolerance_floor(step, name) == 0.0).any()})


def tolerance_floor(step, name):
    """Return what the tolerance of an array is made of: 0 where it is 0."""
    scale = step[f"scale/{name}"][()]
    return scale + step[f"bar/{name}"][()] if f"bar/{name}" in step else scale


def stage_errors(golden, other, precision):
    """Return {stage: its largest difference in units of the tolerance, with the array and step}.

    Where an array departs without such a number, it is None, and "what" says why.
    """
    worst = {}
    with h5py.File(golden) as g, h5py.File(other) as o:
        bodies = list(g["bodies"])
        for step in sorted(o["steps"], key=int):
            theirs = given_arrays(o[f"steps/{step}"], bodies)
            for array, name in golden_arrays(g[f"steps/{step}"], stage_arrays("explicit"), bodies):
                if name in theirs:
                    units, what = largest_difference(
                        *compare_array(g[f"steps/{step}"], theirs, array, name, precision))
                    if units >= worst.get(array.stage, (0.0,))[0]:
                        worst[array.stage] = units, what, name, int(step)
    return {stage: {"units": None if what else units, "what": what, "array": name, "step": step}
            for stage, (units, what, name, step) in worst.items()}


def largest_difference(departure, units):
    """Return the difference of an array over its tolerance, infinite where it has no number, and
    then why. departure, units: as `compare_array` returns them.
    """
    if departure is None:
        return float(units), ""
    if "what" in departure:
        return np.inf, departure["what"]
    if departure["tolerance"] == 0.0:
        return np.inf, "tolerance 0"
    return departure["difference"] / departure["tolerance"], ""


def rotation_errors(answers):
    """Return the largest and the median distance of a backend's rotations, over particles, to those
    of the same F_trial by `double_svd`, with the step and particle of the largest.

    answers: (stages, rotations (N, d, d)) of each step.
    """
    off = []
    for stages, R in answers:
        U, _, V = double_svd(stages["F_trial"])
        off.append(abs(R - U @ V.swapaxes(1, 2)).max(axis=(1, 2)))
    step, particle = np.unravel_index(np.argmax(off), np.shape(off))
    return {"largest": float(np.max(off)), "median": float(np.median(off)), "step": int(step),
            "particle": int(particle)}
