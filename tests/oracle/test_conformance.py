"""Steps of Taichi and Warp under the oracle: `python -m benchmarks conformance`."""

import json
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import conformance
from benchmarks.__main__ import app
from benchmarks.backends import RemoteBackend
from benchmarks.conformance import PACKAGES, PRECISIONS, checked_row, record_case, serve_stages
from benchmarks.conformance_cases import (
    ADJOINT_CASES,
    CASES,
    NODES,
    STEPS,
    Case,
    case_problem,
    double_svd,
    read_seeds,
    read_start,
)
from benchmarks.conformance_table import (
    adjoint_table,
    departure_lines,
    replacement,
    report_line,
    stage_table,
)
from mpm_ref import oracle

ROOT = Path(__file__).resolve().parents[2]
BACKENDS = ("taichi", "warp")
FIELDS = ("mass", "momentum", "force", "velocity", "velocity_bc")
OF_PARTICLES = ("base", "weights", "x", "v", "C", "L", "F_trial", "F", "tau", "energy")


@pytest.fixture(scope="module")
def golden(tmp_path_factory):
    return record_case(Case(2, "mls", "jelly"), tmp_path_factory.mktemp("golden") / "golden.h5")


@pytest.fixture
def arrays(golden):
    """The arrays of the golden file itself, as another code would hand them in."""
    with h5py.File(golden) as f:
        return [{"nodes": step["nodes"][()], **{name: step[name][()] for name in FIELDS},
                 **{name: step[f"body/{name}"][()] for name in OF_PARTICLES}}
                for step in f["steps"].values()]


# cases

@pytest.mark.parametrize("case", CASES, ids=str)
def test_particles_stay_inside_the_nodes_that_backends_have(case):
    problem, begin = case_problem(case)
    x = problem.bodies[0].particles.x
    fastest = 0.0 if case.state == "at rest" else 3.0
    room = problem.dx + (begin + STEPS) * problem.clock.dt * fastest
    assert x.min() > room
    assert x.max() < (NODES - 1) * problem.dx - room
    assert len(x) == {2: 47, 3: 916}[case.dim]


def test_a_start_has_the_numbers_of_the_golden_file(golden):
    start = read_start(golden)
    assert (start.material, start.transfer, start.dim, start.n) == ("jelly", "mls", 2, NODES)
    assert start.mu == pytest.approx(1e5 / 2.6)
    assert start.lam == pytest.approx(0.3e5 / (1.3 * 0.4))
    with h5py.File(golden) as f:
        step = f["steps/0"]
        stopped = (step["velocity"][()] != step["velocity_bc"][()]).any(axis=1)
        assert stopped.any()
        assert start.solid[tuple(step["nodes"][()][stopped].T)].all()
        below = step["nodes"][()][:, 1] * start.dx < 0.23
        assert (start.solid[tuple(step["nodes"][()].T)] == below).all()


def test_sand_sticks_slides_and_opens(tmp_path):
    """A case that took one branch of the return map alone would test little."""
    path = record_case(Case(2, "mls", "sand"), tmp_path / "golden.h5")
    with h5py.File(path) as f:
        F_trial, F = f["steps/0/body/F_trial"][()], f["steps/0/body/F"][()]
    opened = np.linalg.det(F_trial) > 1.0
    changed = abs(F - F_trial).max(axis=(1, 2)) > 1e-9
    assert min(opened.sum(), (changed & ~opened).sum(), (~changed).sum()) > 3


def test_decomposition_in_double_precision():
    F = (np.eye(3) + 0.1 * np.random.default_rng(0).standard_normal((5, 3, 3))).astype(np.float32)
    U, s, V = double_svd(F)
    assert U.dtype == s.dtype == V.dtype == np.float64
    assert np.einsum("pab,pb,pcb->pac", U, s, V) == pytest.approx(F.astype(float), abs=1e-14)


# checks

def test_arrays_of_the_golden_file_agree_at_every_stage(golden, arrays):
    row = checked_row(golden, arrays, "f64")
    assert row["agrees"]
    assert row["missing"] == []
    assert [stage for stage, entry in row["stages"].items() if entry["units"] != 0.0] == []
    assert len(row["stages"]) == 9


def test_an_error_is_found_at_its_stage_in_units_of_the_tolerance(golden, arrays):
    with h5py.File(golden) as f:
        a = f["steps/1/body/C"]
        tol = a.attrs["tolerance_f64"] * f["steps/1/scale/body/C"][3]
    arrays[1]["C"][3, 0, 1] += 50.0 * tol
    row = checked_row(golden, arrays, "f64")
    assert not row["agrees"]
    assert (row["first"]["array"], row["first"]["step"]) == ("body/C", 1)
    assert row["stages"]["g2p"]["array"] == "body/C"
    assert row["stages"]["g2p"]["step"] == 1
    assert row["stages"]["g2p"]["units"] == pytest.approx(50.0, rel=1e-2)
    assert row["stages"]["p2g"]["units"] == 0.0


def test_a_difference_where_the_tolerance_is_0_has_no_number(tmp_path):
    path = record_case(Case(2, "mls", "jelly", "at rest"), tmp_path / "golden.h5")
    with h5py.File(path) as f:
        step = f["steps/0"]
        given = {"nodes": step["nodes"][()], "momentum": step["momentum"][()] + 1e-12}
    row = checked_row(path, [given], "f64")
    assert row["stages"] == {"p2g": {"units": None, "what": "tolerance 0", "array": "momentum",
                                     "step": 0}}


def test_arrays_without_numbers_to_compare_say_why(golden, arrays):
    arrays[0]["C"][3, 0, 1] = np.nan
    arrays[0]["tau"] = arrays[0]["tau"][:-1]
    stages = checked_row(golden, arrays, "f64")["stages"]
    assert stages["g2p"]["units"] is stages["stress"]["units"] is None
    assert stages["g2p"]["what"].endswith("is not finite")
    assert "46" in stages["stress"]["what"]


@pytest.mark.parametrize(("name", "fault"), [
    ("warp ", "warp : unknown; expected some of taichi, warp"),
    ("absent", "absent: it is not installed; pip install")])
def test_a_backend_that_cannot_run_is_refused(name, fault, monkeypatch, tmp_path):
    monkeypatch.setitem(PACKAGES, "absent", "absent")
    out = tmp_path / "a.json"
    said = CliRunner().invoke(app, ["conformance", "--backends", name, "--out", str(out)])
    assert said.exit_code == 2
    assert fault in " ".join(said.output.split())
    assert not out.exists()


def test_rotation_errors_name_the_worst_particle():
    F = np.stack([np.eye(2)] * 4)
    R = F.copy()
    R[2, 0, 1] = 0.25
    answers = [({"F_trial": F}, F), ({"F_trial": F}, R)]
    assert conformance.rotation_errors(answers) == {
        "largest": 0.25, "median": 0.0, "step": 1, "particle": 2}


def test_light_nodes_are_left_out():
    m = np.array([[1.0, 1e-30], [0.0, 1e-6]])
    assert conformance.without_light_nodes({"mass": m, "x": 1})["mass"].tolist() == [
        [1.0, 0.0], [0.0, 1e-6]]


# backends

@pytest.fixture
def backend():
    """A function that starts a backend, or skips the test where it is not installed."""
    started = []

    def start(name, precision):
        if find_spec(name) is None:
            pytest.skip(f"{name} is not installed")
        started.append(RemoteBackend(name, precision, 1, serve_stages))
        return started[-1]

    yield start
    for one in started:
        one.close()


@pytest.mark.parametrize("name", BACKENDS)
def test_a_backend_agrees_and_an_error_is_found_where_it_is(name, golden, backend):
    process, start = backend(name, "f64"), read_start(golden)

    def checked(start):
        return checked_row(golden, [stages for stages, _ in process.run((start, "library"))], "f64")

    row = checked(start)
    assert row["agrees"], row["first"]
    assert (row["arrays"], row["missing"]) == (14 * STEPS, [])
    for change, array in (({"friction": 0.2}, "velocity_bc"), ({"lam": start.lam + 1.0}, "force"),
                          ({"transfer": "apic"}, "force"), ({"gravity": 0.9 * start.gravity},
                                                            "velocity")):
        first = checked(start._replace(**change))["first"]
        assert (first["step"], first["array"]) == (0, array)


@pytest.mark.parametrize("name", BACKENDS)
def test_one_process_makes_steps_in_2d_and_in_3d(name, golden, tmp_path, backend):
    process = backend(name, "f64")
    for path in (golden, record_case(Case(3, "mls", "sand"), tmp_path / "golden.h5")):
        row = checked_row(path, [stages for stages, _ in process.run((read_start(path), "double"))],
                          "f64")
        assert row["agrees"], row["first"]
        process.run((read_start(path), "library"))


@pytest.mark.parametrize("name", BACKENDS)
def test_single_precision_is_single(name, golden, backend):
    answers = backend(name, "f32").run((read_start(golden), "library"))
    stages = [stages for stages, _ in answers]
    assert stages[0]["F"].dtype == stages[0]["velocity"].dtype == np.float32
    assert checked_row(golden, stages, "f32")["agrees"]
    assert not checked_row(golden, stages, "f64")["agrees"]


def test_gradients_of_warp_agree_and_an_error_is_found_where_it_is(tmp_path, backend):
    process = backend("warp", "f64")
    path = record_case(Case(2, "mls", "jelly"), tmp_path / "golden.h5", oracle.record_adjoint)
    starts, seeds = read_seeds(path)
    tasks = list(zip(starts, seeds, strict=True))
    row = checked_row(path, process.run((tasks, "newton")), "f64")
    assert row["agrees"], row["first"]
    seeds[1]["F"] *= 1.001
    first = checked_row(path, process.run((tasks, "newton")), "f64")["first"]
    assert (first["step"], first["stage"]) == (1, "return map adjoint")
    seeds[1]["F"] /= 1.001
    tasks[0] = starts[0]._replace(friction=0.2), seeds[0]
    first = checked_row(path, process.run((tasks, "newton")), "f64")["first"]
    assert (first["step"], first["stage"]) == (0, "boundaries adjoint")


# the table and the record

def row_of(units, case="2D MLS jelly", **fields):
    return {"kind": "steps", "case": case, "backend": "taichi", "precision": "f64",
            "svd": "library", "replaced": [], "agrees": units is not None and units <= 1.0,
            "arrays": 42, "departures": 3, "first": None,
            "stages": {"p2g": {"units": units, "what": "tolerance 0" if units is None else "",
                               "array": "mass", "step": 0}}} | fields


def test_a_cell_has_the_worst_case_and_departures_are_bold():
    rows = [row_of(0.25), row_of(12.3, "3D APIC sand"), row_of(99.0, replaced=["svd"]),
            row_of(None, precision="f32"), row_of(0.5, backend="warp")]
    assert stage_table(rows)[2:] == [
        "| p2g | **12**, 3D APIC sand | **tolerance 0**, 2D MLS jelly | 0.5, 2D MLS jelly |  |"]


def test_a_departure_has_its_place_its_size_and_its_replacement():
    first = {"step": 2, "stage": "return map", "array": "body/F", "where": "particle 7 component 0",
             "difference": 1e-3, "tolerance": 1e-5, "what": ""}
    rotations = {"largest": 1e-3, "median": 2e-7, "step": 2, "particle": 7}
    row = row_of(100.0, first=first, rotations=rotations)
    others = [row_of(0.5, backend="warp"), row, row_of(0.25, replaced=["svd"])]
    assert departure_lines(others)[2:] == [
        "| 2D MLS jelly | Taichi f64 | step 2, body/F, particle 7 component 0 | 1.0e-03 | 1e+02 "
        "| 1.0e-03 (step 2, particle 7), 2.0e-07 | 0.25 (svd) |"]
    assert report_line(row).endswith("f64 departs in 3 of 42, first at return map, body/F;"
                                     " largest difference 1e+02 of its tolerance")


@pytest.fixture(scope="module")
def record():
    return json.loads((ROOT / "results/benchmarks/conformance.json").read_text(encoding="utf-8"))


def test_the_record_has_every_case_backend_and_precision(record):
    steps = {(row["case"], row["backend"], row["precision"]) for row in record["rows"]
             if row["kind"] == "steps"}
    assert steps == {(str(case), name, precision) for case in CASES for name in BACKENDS
                     for precision in PRECISIONS}
    adjoints = {(row["case"], row["precision"]) for row in record["rows"]
                if row["kind"] == "adjoint"}
    assert adjoints == {(str(case), precision) for case in ADJOINT_CASES
                        for precision in PRECISIONS}
    assert set(record["versions"]) == {*PACKAGES.values(), "numpy"}


def test_no_stage_is_left_out(record):
    for row in record["rows"]:
        if row["kind"] == "steps":
            assert row["missing"] == []
            assert len(row["stages"]) == (8 if "fluid" in row["case"] else 9)


def test_what_departs_agrees_once_the_decomposition_is_replaced(record):
    departing = [row for row in record["rows"] if not row["agrees"]]
    assert departing
    for row in departing:
        other = replacement(record["rows"], row)
        assert other["agrees"]
        assert ("nodes" in other["replaced"]) == ("fluid" in row["case"])


def test_bodies_at_rest_have_no_tolerance_in_their_momentum_and_need_none(record):
    at_rest = [row for row in record["rows"] if row["case"].endswith("at rest")]
    assert len(at_rest) >= 24
    assert all(row["exact"] == ["momentum"] for row in at_rest)
    assert all(entry["units"] is not None for row in at_rest for entry in row["stages"].values())


def test_the_tables_of_the_guide_are_those_of_the_record(record):
    page = (ROOT / "docs/howto/check-a-backend.md").read_text(encoding="utf-8")
    rows = record["rows"]
    for lines in (stage_table(rows), adjoint_table(rows), departure_lines(rows)):
        assert "\n".join(lines) in page
