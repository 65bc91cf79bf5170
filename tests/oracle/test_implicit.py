"""Golden files of implicit steps: a second path agrees, and what is wrong is refused by its stage.

The other code is the plain twin in double (or single) precision with products in place of a matrix,
multigrid on SciPy matrices, and Newton's method for the step.
"""

from dataclasses import replace

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from goldens_hot import EPS, STEPS, bodies_at, problem_of, steps_of

from mpm_ref import oracle
from mpm_ref.hot.methods import METHODS, printed
from mpm_ref.hot.multigrid import hierarchy
from mpm_ref.hot.multigrid.projectors import block_diagonal
from mpm_ref.oracle import accepted_step, differential, implicit_twin, recording
from mpm_ref.oracle.implicit_twin import ImplicitTwin, embedding_weights
from mpm_ref.oracle.schema import IMPLICIT, MULTIGRID, key
from mpm_ref.plain import potential
from mpm_ref.simulate import simulate

CHANGE = 1e-6
SOLVE_ARRAYS = 1e-2       # of an array that the tolerance of the solve leaves open: see the bars
MOST = 3            # levels of the hierarchies here


@pytest.fixture(scope="module")
def problem():
    return problem_of(2)


@pytest.fixture(scope="module")
def golden(problem, tmp_path_factory):
    path = tmp_path_factory.mktemp("golden") / "golden.h5"
    oracle.record(problem, path, STEPS, eps=EPS)
    return path


@pytest.fixture(scope="module")
def written(problem, golden):
    return steps_of(problem, golden)


@pytest.fixture
def theirs(written):
    return [{name: a.copy() for name, a in seen.items()} for seen in written]


@pytest.fixture
def checked(golden, tmp_path):
    def check(steps):
        oracle.write(tmp_path / "other.h5", steps)
        return oracle.check(golden, tmp_path / "other.h5")
    return check


# what is recorded

def arrays_here():
    """An elastic body has no history, and the hierarchies here have few levels."""
    fine = [a for a in IMPLICIT if a not in MULTIGRID and a.name != "y"]
    return fine + list(MULTIGRID[:2 * (MOST - 1)])


def test_every_stage_is_recorded_with_its_error(golden):
    with h5py.File(golden) as f:
        step = f["steps/1"]
        assert f.attrs["integrator"] == "implicit"
        assert f.attrs["eps"] == EPS
        for array in arrays_here():
            a = step[key(array, "soft")]
            assert a.attrs["stage"] == array.stage
            assert np.isfinite(step[f"scale/{key(array, 'soft')}"][()]).all()
            assert a.attrs["error_in_units"] < 3.0
        report = step["report"].attrs
        assert report["converged"]
        assert report["iterations"] == len(report["residuals"]) - 1
        assert report["residuals"][-1] <= EPS


def test_recording_leaves_the_problem_alone(problem):
    same = problem_of(2)
    for a, b in zip(problem.bodies, same.bodies):
        assert all(np.array_equal(c, d) for c, d in zip(a.particles, b.particles))


def test_a_file_begins_where_a_run_stands(problem, tmp_path):
    oracle.record(problem, tmp_path / "golden.h5", 1, begin=3)
    ran = [frame for frame in simulate(replace(
        recording.copy_problem(problem, 1), clock=replace(problem.clock, steps=3)))][-1]
    with h5py.File(tmp_path / "golden.h5") as f:
        assert f["steps/0"].attrs["t"] == ran.t
        np.testing.assert_array_equal(f["bodies/hard/x"][()], ran.state.bodies[1].particles.x)


def test_bars_follow_the_tolerance(problem, golden, tmp_path):
    """A tolerance 100 times as large admits increments 100 times as far apart."""
    oracle.record(problem, tmp_path / "golden.h5", 1, eps=100 * EPS)
    with h5py.File(golden) as fine, h5py.File(tmp_path / "golden.h5") as coarse:
        for name in ("dv", "soft/v", "hard/L", "hard/tau", "soft/energy"):
            bars = [f[f"steps/0/bar/{name}"][()] for f in (fine, coarse)]
            np.testing.assert_allclose(bars[1], 100 * bars[0], rtol=0.1,
                                       atol=1e-6 * bars[1].max())


@pytest.mark.parametrize("word", ["gast15", "admm", "hot-quadratic"])
def test_methods_without_the_v_cycle_have_fewer_stages(problem, word, tmp_path):
    oracle.record(replace(problem, solver=printed(word)), tmp_path / "golden.h5", 1)
    with h5py.File(tmp_path / "golden.h5") as f:
        step = f["steps/0"]
        assert ("cycle" in step) == (METHODS[word].inverse == "cycle")
        assert ("direction" in step) == (word != "admm")
        assert {"dv", "gradient_start", "product_trial", "soft/F"} < set(
            [*step, *(f"soft/{name}" for name in step["soft"])])


def test_a_step_that_is_not_solved_is_refused(problem, tmp_path):
    capped = replace(problem, solver=printed("hot", max_iterations=1))
    with pytest.raises(ValueError, match="the implicit step was not solved: 1 iterations, the cap"):
        oracle.record(capped, tmp_path / "golden.h5", 1)
    assert not list(tmp_path.iterdir())


# who agrees

def test_a_second_path_agrees(checked, theirs):
    report = checked(theirs)
    assert report.agrees, str(report)
    assert not report.missing
    assert not report.unknown
    assert 0.0 < report.nearest < 0.5


def test_a_golden_file_agrees_with_itself(golden):
    report = oracle.check(golden, golden)
    assert report.agrees
    assert report.nearest == 0.0


def test_single_precision_agrees_at_its_own_tolerance(problem, golden, tmp_path):
    oracle.write(tmp_path / "other.h5", steps_of(problem, golden, np.float32))
    report = oracle.check(golden, tmp_path / "other.h5")
    assert report.precision == "f32"
    assert report.agrees, str(report)
    assert not oracle.check(golden, tmp_path / "other.h5", precision="f64").agrees


@pytest.mark.parametrize("case", [(2, "separate"),
                                  pytest.param((3, "slip"), marks=pytest.mark.slow)], ids=str)
def test_other_conditions_and_dimensions(case, tmp_path):
    problem, path = problem_of(*case), tmp_path / "golden.h5"
    oracle.record(problem, path, 1, eps=EPS)
    oracle.write(tmp_path / "other.h5", steps_of(problem, path))
    report = oracle.check(path, tmp_path / "other.h5")
    assert report.agrees, str(report)
    assert not report.missing


def test_nodes_in_another_order_agree(checked, theirs):
    for seen in theirs:
        for level in ("", "1", "2"):
            on = [a.name for a in arrays_here()
                  if a.location == "nodes" and str(a.level or "") == level]
            for name in [f"nodes{level}", *on]:
                seen[name] = seen[name][::-1]
    assert checked(theirs).agrees


@pytest.mark.parametrize("word", ["hot", "lbfgs-h", "pn-pcg"])
def test_what_any_method_accepts_is_within_the_bar(problem, golden, checked, word):
    """Their increments differ by up to all that the tolerance admits; an early stop differs more.
    """
    with h5py.File(golden) as f:
        posed = replace(problem, bodies=bodies_at(problem, f, 0))
        nodes, dt = f["steps/0/nodes"][()], f["steps/0"].attrs["dt"]
    stepper = recording.start_stepper(posed)
    for eps, agrees in ((EPS, True), (1e5 * EPS, False)):
        options = printed(word, eps=eps)
        _, dv = accepted_step.solve_with(stepper, posed.bodies, (0.0, dt), options)
        report = checked([{"nodes": nodes, "dv": dv}])
        assert report.agrees is agrees, str(report)


# who does not

def leaky(A, index, **options):
    """Identity rows for what is held, left in the matrix of which coarse ones are made."""
    grids = hierarchy.hierarchy(A, index, **options)
    free = [np.tile(np.eye(index.shape[1]), (len(level.index), 1, 1)) for level in grids.levels]
    A = A + block_diagonal(np.abs(A.data).max() * (free[0] - grids.levels[0].B))
    for k, (fine, coarse) in enumerate(zip(grids.levels, grids.levels[1:])):
        W = sp.csr_array(embedding_weights(fine.index, coarse.index, "linear"))
        A = hierarchy.galerkin(A, hierarchy.prolongation(W, free[k]))
        grids.levels[k] = fine._replace(B=free[k])
        grids.levels[k + 1] = coarse._replace(A=A)
    return grids


def scaled(monkeypatch, module, name, factor):
    real = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *a: factor * real(*a))


def unprojected(monkeypatch):
    monkeypatch.setattr(differential, "semidefinite", lambda A: A)
    monkeypatch.setattr(implicit_twin, "stress_differential", exact_differential)


def exact_differential(F, law):
    U, s, V = differential.svd(F)
    A, quotients = differential.slopes(s, law), differential.difference_quotients(s, law)
    return differential.StressDifferential(U, V, A, *quotients)


def wrong_kappa(monkeypatch):
    """The surface of a cell, of side dx, in place of that of side 2 dx."""
    real = ImplicitTwin.kappa
    monkeypatch.setattr(ImplicitTwin, "kappa", lambda twin: real(twin) / 2)


def twice_smoothed(A, index, **options):
    return hierarchy.hierarchy(A, index, sweeps=2, **options)


def wrong_levels(made):
    """The other code makes its hierarchy by `made`."""
    return lambda monkeypatch: monkeypatch.setattr("goldens_hot.hierarchy", made)


WRONG = {
    "no dt in the force": ("potential", lambda m: scaled(m, potential, "internal_force", 0.5)),
    "energy": ("potential", lambda m: scaled(m, potential, "elastic_energy", 1 + CHANGE)),
    "Hessian": ("Hessian", lambda m: scaled(m, implicit_twin, "apply_differential", 1 + CHANGE)),
    "no projection": ("Hessian", unprojected),
    "norm": ("norms", wrong_kappa),
    "identity rows": ("prolongation", wrong_levels(leaky)),
    "smoothing": ("V-cycle", wrong_levels(twice_smoothed)),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_code_is_refused_by_its_stage(wrong, problem, golden, checked, monkeypatch):
    stage, mutate = WRONG[wrong]
    mutate(monkeypatch)
    report = checked(steps_of(problem, golden))
    assert report.first.stage == stage, str(report)
    assert report.first.step == 0


def test_a_leak_shows_in_coarse_matrices_too(problem, golden, checked, monkeypatch):
    wrong_levels(leaky)(monkeypatch)
    steps = [{name: a for name, a in seen.items() if not name.startswith("prolonged")}
             for seen in steps_of(problem, golden)]
    assert checked(steps).first.stage == "coarse matrix"


def test_wrong_weights_of_the_embedding_are_refused(checked, theirs, golden):
    for seen in theirs:
        seen["prolonged1"] = seen["prolonged1"] / 2
    assert checked(theirs).first.stage == "prolongation"


def test_an_increment_with_its_last_step_twice_is_refused(checked, theirs):
    """What the public release does: the direction once more."""
    theirs[0]["dv"] = theirs[0]["dv"] + SOLVE_ARRAYS * theirs[0]["direction"]
    assert checked(theirs).first.array == "dv"


@pytest.mark.parametrize("array", [a.name for a in arrays_here()])
def test_a_change_of_one_entry_is_caught_and_located(array, golden, checked, theirs):
    array = next(a for a in arrays_here() if a.name == array)
    name = key(array, "soft")
    a = theirs[1][name]
    change, size = CHANGE, abs(a)
    with h5py.File(golden) as f:
        if f"bar/{name}" in f["steps/1"]:
            change = SOLVE_ARRAYS
            bar = f[f"steps/1/bar/{name}"][()]
            size = (size.T / np.maximum(bar, 1e-3 * bar.max()).T).T
    i = np.unravel_index(np.argmax(size), a.shape)
    a[i] *= 1 + change
    first, = checked(theirs).departures
    assert (first.step, first.array, first.stage) == (1, name, array.stage)
    assert first.other == a[i]
    if array.level:
        assert f"of level {array.level}" in first.where
