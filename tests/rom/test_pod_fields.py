"""Fields as sums of modes, and the radial functions that their coefficients are."""

import numpy as np
import pytest

from mpm_ref.rom.fields import pod_fields as module
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields, modes_of
from mpm_ref.rom.fields.radial_basis import through
from mpm_ref.rom.snapshots import Histories, join_histories
from mpm_ref.rom.study.monitor import latent_modes
from mpm_ref.rom.symmetric import tensor, values

LEVELS, N, DT = 9, 60, 0.01


def bent(d, mu, seed=3):
    """A run whose points swing by mu along two fixed patterns, with stress and affine field that
    follow from the phase, and from mu.
    """
    rng = np.random.default_rng(seed)
    X = rng.uniform(size=(N, d))
    first, second, third = (rng.normal(size=(N, k)) for k in (d, d, d))
    P, R = rng.normal(size=(2, N, d * (d + 1) // 2))
    Q = rng.normal(size=(N, d * d))
    phase = np.linspace(0.0, 2.0, LEVELS)[:, None, None]
    a, b = mu * np.sin(phase), mu * (1.0 - np.cos(phase))
    x = X + 0.1 * (a * first + b * second + a * b * third)
    ones = np.ones(N)
    return Histories(X, ones, ones / N, np.zeros((1, N, d)), np.array([[mu]]), x[None],
                     (mu * P * (1.0 + a) + b * R)[None], (Q * b)[None], DT)


@pytest.fixture
def runs(d):
    """Histories of four runs."""
    return join_histories([bent(d, mu) for mu in (0.4, 0.6, 0.8, 1.0)])


@pytest.fixture
def made(runs):
    """Fields of these runs, and their latent coordinates."""
    return fit_pod_fields(runs, Sizes(r=2, modes=3, tau=2, C=1), 0.3)


ALL = np.arange(N)


def test_tensors_and_their_values(d, rng):
    a = rng.normal(size=(5, d, d))
    a += a.transpose(0, 2, 1)
    assert values(a).shape == (5, d * (d + 1) // 2)
    assert np.array_equal(tensor(values(a), d), a)


def test_fields_meet_the_runs_they_are_made_of(made, runs, d):
    fields, xhat = made
    for k in range(len(runs.mu)):
        one = fields.with_parameters(runs.mu[k])
        for level in range(LEVELS):
            y = xhat[k, level]
            assert np.abs(one.place(ALL, y) - runs.x[k, level]).max() < 1e-6
            assert np.abs(values(one.stress(ALL, y)) - runs.tau[k, level]).max() < 1e-5
            C = runs.C[k, level].reshape(N, d, d)
            assert np.abs(one.affine(ALL, y) - C).max() < 1e-5


def test_fields_between_runs_are_between(made, d):
    fields, _ = made
    new = bent(d, 0.7)
    one = fields.with_parameters(new.mu[0])
    U = fields.U.reshape(-1, 3)
    for level in range(LEVELS):
        y = (U.T @ (new.x[0, level] - new.X).ravel())[:2]
        assert np.abs(one.place(ALL, y) - new.x[0, level]).max() < 3e-3
        assert np.abs(values(one.stress(ALL, y)) - new.tau[0, level]).max() < 0.05


def test_parameters_tell_runs_apart_that_start_alike(made, runs):
    fields, xhat = made
    rest = xhat[:, 0].mean(axis=0)
    low, high = (fields.with_parameters(mu).stress(ALL, rest) for mu in runs.mu[[0, -1]])
    assert np.linalg.norm(high) == pytest.approx(2.5 * np.linalg.norm(low), rel=1e-3)


def test_stress_that_knows_no_parameters_is_one_for_all(runs):
    fields, xhat = fit_pod_fields(runs, Sizes(r=2, modes=3, tau=2, C=1), 0.3, follows=False)
    assert fields.mu.shape == (0,)
    assert fields.stress(ALL, xhat[0, 3]).shape == (N, runs.X.shape[1], runs.X.shape[1])


@pytest.mark.parametrize("modes", [2, 3])
def test_derivatives_by_differences(runs, modes, rng):
    fields, xhat = fit_pod_fields(runs, Sizes(r=2, modes=modes, tau=2, C=1), 0.3)
    y, direction = xhat[1, 4], rng.normal(size=2) * np.abs(xhat).max()
    x, none, G = fields.derivatives(ALL, y)
    assert none is None
    assert np.array_equal(x, fields.place(ALL, y))
    errors = [np.abs(fields.place(ALL, y + t * direction) - x - t * (G @ direction)).max()
              for t in (1e-2, 5e-3)]
    if modes == 2:
        assert max(errors) < 1e-13
    else:
        assert 3.0 < errors[0] / errors[1] < 5.0


def test_points_by_their_numbers(made):
    fields, xhat = made
    some, y = np.array([41, 2, 17]), xhat[2, 5]
    for name in ("place", "stress", "affine"):
        few, everything = (getattr(fields, name)(points, y) for points in (some, ALL))
        assert np.abs(few - everything[some]).max() < 1e-14
    assert np.array_equal(fields.derivatives(some, y)[2], fields.derivatives(ALL, y)[2][some])


def test_modes_in_single_precision_tell_the_same_to_it(made, d):
    fields, xhat = made
    rounded, y = fields.single(), xhat[1, 4]
    assert [modes.dtype for modes in (rounded.U, rounded.tau.modes, rounded.C.modes)] == [
        np.float32] * 3
    pairs = [*((getattr(one, name)(ALL, y) for one in (fields, rounded))
               for name in ("place", "stress", "affine")),
             [one.derivatives(ALL, y)[2] for one in (fields, rounded)]]
    for exact, near in map(tuple, pairs):
        assert 0.0 < np.abs(near - exact).max() < 1e-6 * np.abs(exact).max()
        assert near.dtype == float
    order, start, middle, _, spread = rounded.cells
    for b, own in enumerate(np.split(order, start[1:-1])):
        apart = np.abs(rounded.U[own] - rounded.U[middle[b]]).max(axis=(0, 1))
        assert np.array_equal(spread[b], apart)         # bounds hold of the modes as they are
    assert latent_modes(rounded, ALL).dtype == float        # what a monitor sums


@pytest.mark.parametrize("digits", ["double", "single"])
def test_no_point_that_is_near_is_overlooked(made, digits):
    fields, xhat = made
    fields = fields.single() if digits == "single" else fields
    for y in (xhat[0, 0], xhat[3, -1], 3.0 * xhat[3, -1]):
        x = fields.place(ALL, y)
        for distance in (0.02, 0.1):
            at = x[[7]]
            near = np.flatnonzero(np.abs(x - at).max(axis=1) <= distance)
            found = fields.near(y, at, distance)
            assert np.isin(near, found).all()
            assert len(np.unique(found)) == len(found)


def test_few_points_are_looked_at_where_few_are_near(runs):
    fields, xhat = fit_pod_fields(runs, Sizes(r=2, modes=2, tau=1, C=1), 0.1)
    x = fields.place(ALL, xhat[0, 0])
    assert len(fields.near(xhat[0, 0], x[[7]], 0.05)) < N // 2


def test_without_an_affine_field(runs, d):
    fields, xhat = fit_pod_fields(runs, Sizes(r=2, modes=3, tau=2, C=0), 0.3)
    assert fields.C is None
    assert not fields.affine(ALL, xhat[0, 2]).any()


def test_more_modes_than_the_runs_hold_are_refused(runs):
    with pytest.raises(ValueError, match=r"modes = 30: expected 1 \.\. \d+, as many modes as"):
        fit_pod_fields(runs, Sizes(r=2, modes=30), 0.3)
    with pytest.raises(ValueError, match=r"tau = 40: expected 1 \.\. 2"):
        fit_pod_fields(runs, Sizes(r=2, modes=3, tau=40), 0.3)


# radial functions

def test_radial_functions_meet_their_values(rng):
    y, f = rng.normal(size=(40, 3)), rng.normal(size=(40, 2))
    found = through(y, f, np.ones(3))
    assert max(np.abs(found.value(a) - b).max() for a, b in zip(y, f, strict=True)) < 1e-6


def test_linear_functions_are_found_everywhere(rng):
    y, A = rng.normal(size=(20, 3)), rng.normal(size=(3, 2))
    found = through(y, 0.3 + y @ A, np.array([2.0, 0.1, 1.0]))
    away = 10.0 * rng.normal(size=3)
    assert np.abs(found.value(away) - 0.3 - away @ A).max() < 1e-6
    assert np.abs(found.slope(away) - A.T).max() < 1e-6


def test_slopes_by_differences(rng):
    y, f = rng.normal(size=(30, 3)), rng.normal(size=(30, 2))
    found = through(y, f, np.array([2.0, 0.5, 1.0]))
    at, direction = rng.normal(size=3), rng.normal(size=3)
    errors = [np.abs(found.value(at + t * direction) - found.value(at)
                     - t * (found.slope(at) @ direction)).max() for t in (1e-3, 5e-4)]
    assert 3.5 < errors[0] / errors[1] < 4.5


def test_values_that_contradict_each_other_are_met_in_the_middle(rng):
    y, f = rng.normal(size=(12, 2)), rng.normal(size=(12, 1))
    y, f = np.vstack([y, y[:1]]), np.vstack([f, f[:1] + 1.0])
    assert through(y, f, np.ones(2)).value(y[0]) == pytest.approx(f[0] + 0.5, abs=1e-4)


def test_parameters_weigh_as_told(runs):
    """Spread for spread: twice the weight is half the unit."""
    for weight in (1.0, 2.0):
        fields, _ = fit_pod_fields(runs, Sizes(r=2, modes=3, tau=2, C=1, weight=weight), 0.3)
        assert fields.tau.coefficients.unit[2:] == pytest.approx(runs.mu.std(axis=0) / weight)


@pytest.mark.parametrize("constant", [0.0, 0.3, 0.45, 1.7])
def test_a_coordinate_that_does_not_vary_says_nothing(rng, constant):
    """Such as a parameter of one run, wherever it is asked later."""
    y = np.hstack([rng.normal(size=(12, 1)), np.full((12, 1), constant)])
    found = through(y, 2.0 * y[:, :1] + 3.0, np.ones(2))
    for other in (constant, constant + 0.1, 5.0):
        at = np.array([0.5, other])
        assert found.value(at) == pytest.approx(4.0, abs=1e-6)
        assert found.slope(at) == pytest.approx(np.array([[2.0, 0.0]]), abs=1e-5)


def test_coordinates_that_say_the_same_share_it(rng):
    """Two parameters of which one follows from the other: of all answers the smallest."""
    for k in range(20):
        slope, start = 0.3 + 0.17 * k, 0.1 * k
        y = rng.normal(size=(12, 1)) @ [[1.0, slope]] + [0.0, start]
        found = through(y, y[:, :1], np.ones(2))
        assert found.value(np.array([0.5, 0.5 * slope + start])) == pytest.approx(0.5, abs=1e-6)
        assert [start, slope, -1.0] @ found.tail == pytest.approx(0.0, abs=1e-9)


def test_smoothing_meets_values_less_and_bends_less(rng):
    y = np.linspace(-1.0, 1.0, 21)[:, None]
    values = y + 0.1 * rng.normal(size=y.shape)
    off, bends = zip(*((np.abs([found.value(one) - b for one, b in zip(y, values)]).max(),
                        np.abs(found.w).max())
                       for found in (through(y, values, np.ones(1), s) for s in (0.0, 1e-2, 1e3))))
    assert off[0] < 1e-9 < off[1] < off[2]
    assert bends[0] > bends[1] > bends[2]
    line = np.polynomial.Polynomial.fit(y[:, 0], values[:, 0], 1)
    smooth = through(y, values, np.ones(1), 1e9)
    assert smooth.value(np.array([0.4])) == pytest.approx(line(0.4), abs=1e-6)


def test_what_radial_functions_refuse():
    with pytest.raises(ValueError, match="3 snapshots for functions of 3 coordinates"):
        through(np.zeros((3, 3)), np.zeros((3, 1)), np.ones(3))
    with pytest.raises(ValueError, match="not finite"):
        through(np.full((5, 1), np.nan), np.zeros((5, 1)), np.ones(1))


def test_cached_modes_are_not_computed_again(runs, monkeypatch):
    """And the fields are the same to the last bit; of another number they are found."""
    sizes, cache, found = Sizes(r=2, modes=3, tau=2, C=1), {}, []
    whole, xhat = fit_pod_fields(runs, sizes, 0.3, cache=cache)

    def finding(A, count, name, origin=None):
        found.append(name)
        return modes_of(A, count, name, origin)

    monkeypatch.setattr(module, "modes_of", finding)
    fewer, _ = fit_pod_fields(runs, sizes._replace(r=1, C=0), 0.3, follows=False, cache=cache)
    assert found == []
    again, at = fit_pod_fields(runs, sizes, 0.3, cache=cache)
    assert np.array_equal(at, xhat)
    for ours, theirs in ((again.U, whole.U), (again.tau.modes, whole.tau.modes),
                         (again.C.modes, whole.C.modes), (fewer.tau.modes, whole.tau.modes)):
        assert np.array_equal(ours, theirs)
    fit_pod_fields(runs, sizes._replace(modes=2), 0.3, cache=cache)
    assert found == ["modes"]
