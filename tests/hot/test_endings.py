"""Every solve on small systems ends, and says how; options that make no sense are refused."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from hot_toys import DESCENTS, Exact, bar, exactly, quadratic, scalar, tight

from mpm_ref.hot.descent import StoppingRule, descend
from mpm_ref.hot.lbfgs import LBFGS
from mpm_ref.hot.line_search import Iterate, LineSearchOptions, search
from mpm_ref.hot.linearization import Linearization
from mpm_ref.hot.methods import (
    CHOICES,
    METHODS,
    PRINTED,
    SolverOptions,
    minimise,
    options_of,
    printed,
)
from mpm_ref.hot.norms import scaled_norm
from mpm_ref.hot.report import Profiler


@pytest.fixture(autouse=True)
def hierarchies(monkeypatch):
    """Multigrid has tests of its own."""
    return exactly(monkeypatch)


@pytest.mark.parametrize("word", DESCENTS)
def test_capped_solve_says_so_and_returns_the_smallest_gradient(word):
    toy = bar()
    solution = minimise(toy, word, max_iterations=3)
    report = solution.report
    assert not report.converged
    assert "3 iterations, the cap" in report.message
    assert report.iterations == 3
    at_end = scaled_norm(toy.evaluate(solution.dv)[1], toy.kappa)
    if METHODS[word].norm == "characteristic":
        assert at_end == min(report.residuals)


@pytest.mark.parametrize("word", DESCENTS)
def test_energy_without_value_beyond_a_limit_is_avoided(word):
    def E(x):
        return 0.5 * x * x - 40.0 * x - np.log(1.0 - x * x) if x < 1.0 else np.nan
    toy = scalar(E, lambda x: x - 40.0 + 2 * x / (1 - x * x),
                 lambda x: 1 + 2 * (1 + x * x) / (1 - x * x) ** 2)
    solution = minimise(toy, tight(word, 1e-8))
    assert solution.report.converged
    assert solution.report.backtracks > 0
    assert 0.9 < solution.dv[0, 0] < 1.0


@pytest.mark.parametrize("word", DESCENTS)
def test_no_node_at_all_is_solved_at_once(word):
    nothing = quadratic(np.empty((0, 2, 0, 2)), np.empty((0, 2)))
    assert minimise(nothing, word).report.converged


def test_step_to_a_gradient_without_value_is_refused():
    toy = scalar(lambda x: -x, lambda x: -1.0 if x < 1.0 else np.nan, lambda x: 1e-3)
    now = Iterate(toy.start, *toy.evaluate(toy.start))
    found = search(toy, now, np.array([[3.0]]), LineSearchOptions())
    assert found.backtracks == 2
    assert found.point.dv[0, 0] == 0.75


@pytest.mark.parametrize("word", DESCENTS)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_start_without_energy_is_reported(word, bad):
    toy = scalar(lambda x: bad, lambda x: 1.0, lambda x: 1.0)
    report = minimise(toy, word).report
    assert not report.converged
    assert "expected finite values" in report.message
    assert report.iterations == 0


@pytest.mark.parametrize("word", DESCENTS)
def test_matrix_without_value_is_reported(word):
    toy = scalar(lambda x: x, lambda x: 1.0, lambda x: np.nan)
    report = minimise(toy, word).report
    assert not report.converged
    assert "direction is not finite" in report.message


@pytest.mark.parametrize("word", DESCENTS)
def test_uphill_direction_is_reported_and_not_taken(word):
    toy = scalar(lambda x: np.cos(x), lambda x: -np.sin(x), lambda x: -np.cos(x), start=0.5)
    solution = minimise(toy, word)          # concave: minus the gradient over H climbs
    assert not solution.report.converged
    assert "not a descent direction: g . p = " in solution.report.message
    assert solution.dv[0, 0] == 0.5
    assert solution.report.iterations == 0


def test_lbfgs_starts_afresh_when_what_it_learnt_points_uphill():
    toy = bar()
    trust = []

    def build(dv):
        trust.append(0)
        inverse = Exact(toy.matrix(dv)).cycle

        def ages(r):
            trust[-1] += 1
            return -inverse(r) if len(trust) == 1 and trust[-1] > 2 else inverse(r)
        return Linearization(None, ages)

    profiler = Profiler()
    _, why = descend(toy, LBFGS(build, 8, 0),
                     StoppingRule(1e-9, "characteristic", 100, 50), LineSearchOptions(), profiler)
    assert why is None
    assert profiler.restarts == 1
    assert len(trust) == 2


@pytest.mark.parametrize(("rules", "refused", "said"), [
    (LineSearchOptions(cap=7), 8, "cap"), (LineSearchOptions(floor=1e-2), 7, "floor"),
    (LineSearchOptions(shrink=0.1), 11, "floor")])
def test_line_search_is_bounded(rules, refused, said):
    toy = scalar(lambda x: abs(x), lambda x: -1.0, lambda x: 1.0)       # the gradient lies
    now = Iterate(toy.start, *toy.evaluate(toy.start))
    found = search(toy, now, np.ones((1, 1)), rules)
    assert found.point is None
    assert found.backtracks == refused
    assert f"refused {refused} steps, down to its {said}" in found.message
    report = minimise(toy, "hot", search=rules).report
    assert not report.converged
    assert report.backtracks == refused
    assert found.message == report.message


def buried():
    """The bar, with a large constant in its energy and round-off that always goes up."""
    toy, calls = bar(), count()
    E, dE, H = toy.functions
    toy.functions = (lambda x: 1e6 + 1e-7 * next(calls) + E(x), dE, H)
    return toy


@pytest.mark.parametrize("word", DESCENTS)
def test_slopes_decide_where_the_energy_is_lost_in_round_off(word):
    plain = minimise(buried(), tight(word, 1e-9), search=LineSearchOptions(noise=0.0)).report
    aware = minimise(buried(), tight(word, 1e-9)).report
    assert aware.converged
    assert aware.backtracks == 0
    assert not plain.converged
    assert "the line search refused" in plain.message


def test_tolerance_below_round_off_ends_with_a_diagnosis():
    report = minimise(bar(), "hot", eps=1e-30, patience=20).report
    assert not report.converged
    assert report.iterations < 200
    assert "line search" in report.message or "near the limit of round-off" in report.message
    assert min(report.residuals) < 1e-12


def test_patience_ends_a_walk_on_the_spot():
    toy = scalar(lambda x: 1.0, lambda x: 1.0, lambda x: 1e20)      # flat, with a slope that lies
    toy.functions = (toy.functions[0], lambda x: np.sign(0.5 - x), toy.functions[2])
    report = minimise(toy, "pn-pcg", patience=4).report
    assert "neither energy nor gradient fell in 4 iterations" in report.message
    assert report.iterations == 4


def test_patience_bears_a_slow_descent():
    far = 80.0          # steps of one, each of which lowers the energy by 1e-12 of itself
    toy = scalar(lambda x: 1.0 - 1e-12 * min(x, far), lambda x: -1e-12 if x < far else 0.0,
                 lambda x: 1e-12)
    report = minimise(toy, "pn-pcg", eps=1e-14).report
    assert report.converged, report.message
    assert report.iterations == far


# Options.

def test_default_is_hot_as_printed_but_for_what_printed_names():       # HOT-alg3, HOT-smoother
    hot = printed("hot")
    assert hot == replace(METHODS["hot"], **PRINTED) == replace(SolverOptions(), **PRINTED)
    assert (hot.window, hot.levels, hot.kernel, hot.eps) == (8, 3, "linear", 1e-7)
    assert (hot.start, hot.norm, hot.rebuild_every) == ("zero", "characteristic", 0)
    assert minimise(bar()).report.method == minimise(bar(), SolverOptions()).report.method == "hot"


def test_changes_apply_to_words_and_options():
    assert minimise(bar(), "pn-pcg", eps=1e-3).report.iterations == minimise(
        bar(), options_of("pn-pcg", eps=1e-3)).report.iterations < minimise(
        bar(), replace(METHODS["pn-pcg"])).report.iterations


@pytest.mark.parametrize("name", sorted(CHOICES))
def test_unknown_word_is_refused(name):
    with pytest.raises(ValueError, match=f"{name} = 'magic': expected one of"):
        SolverOptions(**{name: "magic"})


@pytest.mark.parametrize("change", [
    {"eps": 0.0}, {"patience": 0}, {"levels": 0}, {"window": -1}, {"rebuild_every": -1},
    {"max_iterations": -1}, {"operator": "matrix-free"},
    {"operator": "matrix-free", "inverse": "sgs"},
    {"descent": "newton", "inverse": "cg"}])
def test_senseless_options_are_refused(change):
    with pytest.raises(ValueError, match="expected"):
        SolverOptions(**change)


def test_unknown_method_is_refused():
    with pytest.raises(ValueError, match="method = 'magic': expected one of"):
        minimise(bar(), "magic")
