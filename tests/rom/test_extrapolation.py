"""How far latent coordinates are from the trained ones: gaps, metrics, thin directions, holes."""

import numpy as np
import pytest
import rom_toys

from mpm_ref.rom.extrapolation import THIN, extent, motion_metric, trained_paths

H, STEP = 0.5, 0.1      # of `comb`: distance of runs, and of latents in a run


def comb(runs=4, levels=9):
    """Parallel straight runs in a plane, (runs, levels, 2)."""
    along, across = np.meshgrid(STEP * np.arange(levels), H * np.arange(runs))
    return np.stack([along, across], axis=-1)


def swing(mu, levels=30):
    """Runs (m, levels, 3) that grow with a parameter mu (m,) and begin at rest."""
    t = np.linspace(0.0, 2.5, levels)
    return np.multiply.outer(mu, np.stack([np.sin(t), 1.0 - np.cos(t), 0.3 * t**2], axis=1))


def rotation(r, seed=0):
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(r, r)))[0]


# The gap.

def test_the_gap_is_between_runs_not_within_them():
    found = extent(comb(), np.eye(2))
    assert found.gap == pytest.approx(H, rel=1e-14)
    place = np.array([[0.0, 0.0], [0.5 * STEP, 0.0], [0.0, 0.5 * H], [0.0, -H], [0.0, -3.0 * H]])
    assert found.beyond(place) == pytest.approx([0.0, 0.5 * STEP / H, 0.5, 1.0, 3.0], abs=1e-14)


def test_of_a_single_run_it_is_the_largest_step():
    run = np.array([[[0.0], [1.0], [3.0], [3.5]]])
    assert extent(run, np.eye(1)).gap == 2.0


def test_without_runs_it_is_between_latents():
    assert extent(np.array([[0.0], [1.0], [1.0], [3.0], [3.5]]), np.eye(1)).gap == 1.0


@pytest.mark.parametrize("metric", [None, np.diag([1.0, 2.0, 0.5])], ids=["spread", "metric"])
def test_runs_between_the_trained_ones_are_inside_and_others_are_not(metric):
    found = extent(swing(np.linspace(1.0, 2.0, 6)), metric)
    between, far = swing(np.linspace(1.1, 1.9, 5)), swing(np.array([-1.0, 2.5]))
    assert 0.3 < found.beyond(between).max() < 0.6      # a half, where runs are straight
    assert (found.beyond(far).max(axis=1) > 2.0).all()
    assert (found.beyond(far)[:, 0] < 1e-12).all()      # they begin where all begin
    assert (found.beyond(swing(np.linspace(1.0, 2.0, 6))) < 1e-12).all()


def test_a_hole_is_outside_though_it_is_near_the_mean():
    angle = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = extent(ring[:, None] * np.array([1.0, 1.05])[:, None])
    assert found.outlying(np.zeros(2)) < 1e-12
    assert found.beyond(np.zeros(2)) > 3.0
    assert found.outlying(1.05 * ring) == pytest.approx(1.0)


# The distance.

def test_a_metric_says_what_a_change_is_worth():
    found = extent(comb(), np.diag([4.0, 1e-6]))
    assert found.gap == pytest.approx(1e-3 * H, rel=1e-9)
    assert found.beyond([-STEP, 0.0]) == pytest.approx(2.0 * STEP / (1e-3 * H), rel=1e-9)
    assert found.beyond([0.0, -H]) == pytest.approx(1.0, rel=1e-9)


def test_a_direction_that_moves_nothing_counts_for_nothing():
    assert extent(comb(), np.diag([0.0, 1.0])).beyond([1e6, 0.0]) == 0.0


@pytest.mark.parametrize("with_metric", [True, False])
def test_other_latent_coordinates_of_the_same_set_give_the_same(with_metric, rng):
    runs, there = rng.normal(size=(4, 5, 3)), 3.0 * rng.normal(size=(20, 3))
    A, c = np.diag([1.0, 3.0, 0.5]) @ rotation(3), rng.random(3)
    back = np.linalg.inv(A)
    one = extent(runs, np.eye(3) if with_metric else None)
    other = extent(runs @ A + c, back @ back.T if with_metric else None)
    assert other.beyond(there @ A + c) == pytest.approx(one.beyond(there), rel=1e-9)
    assert other.outlying(there @ A + c) == pytest.approx(one.outlying(there), rel=1e-9)


@pytest.mark.parametrize("noise", [0.0, 1e-13])
def test_latents_that_span_less_than_all_directions(noise, rng):
    """In their plane all is as in the plane alone; off it a change is not lost, nor blown up."""
    flat, Q, there = comb(), rotation(5), rng.normal(size=(20, 2))
    noisy = flat @ Q[:2] + noise * rng.normal(size=(*flat.shape[:2], 5))
    plane, space = extent(flat), extent(noisy)
    assert space.beyond(there @ Q[:2]) == pytest.approx(plane.beyond(there), rel=1e-8)
    unit = THIN * flat.reshape(-1, 2).std(axis=0).max()
    assert space.beyond(unit * Q[4]) * space.gap == pytest.approx(1.0, rel=1e-8)


def test_without_a_metric_outlying_is_the_mahalanobis_distance(rng):
    latents = rng.normal(size=(50, 3)) @ np.diag([1.0, 0.8, 0.4]) @ rotation(3)
    off = latents - latents.mean(axis=0)
    inverse = np.linalg.inv(np.cov(latents.T, bias=True))
    distance = np.sqrt(np.einsum("pi,ij,pj->p", off, inverse, off))
    assert extent(latents).outlying(latents) == pytest.approx(distance / distance.max(), rel=1e-12)


# The metric of a map.

def test_motion_is_the_root_mean_square_motion_of_the_points(d, rng):
    """Exactly so for a map that is linear in its coordinates."""
    map, xhat = rom_toys.affine(d)
    X, change = rom_toys.cloud(d, 30), rng.normal(size=map.r)
    metric = motion_metric(map, X, np.stack([xhat, 2.0 * xhat]))
    moved = map.place(X, xhat + change) - map.place(X, xhat)
    assert change @ metric @ change == pytest.approx(np.sum(moved**2) / len(X), rel=1e-12)


def test_motion_is_a_mean_over_latents_of_runs(d, rng):
    map, X, runs = rom_toys.decoder(d, 2), rom_toys.cloud(d, 10), rng.uniform(-1.0, 1.0, (2, 3, 2))
    each = [motion_metric(map, X, y) for y in runs.reshape(-1, 2)]
    np.testing.assert_allclose(motion_metric(map, X, runs), np.mean(each, axis=0), rtol=1e-12)
    assert np.ptp(each, axis=0).max() > 0.01 * np.abs(each).max()


def test_drift_where_no_point_moves_is_inside(d):
    """What no metric can know, the spread of the latents does not tell."""
    map = rom_toys.decoder(d, 3)
    map.net.W[:map.net.sizes[1] * (d + 3)].reshape(d + 3, -1)[-1] = 0.0
    runs = 0.4 * swing(np.linspace(1.0, 2.0, 6))
    runs[..., 2] *= 0.05
    drift = runs[3] + np.array([0.0, 0.0, 0.5])
    assert extent(runs, motion_metric(map, rom_toys.cloud(d, 20), runs)).beyond(drift).max() < 1e-6
    assert extent(runs).beyond(drift).max() > 3.0


# Shapes, and what is refused.

def test_any_shape_of_latents(rng):
    found, there = extent(comb()), rng.normal(size=(3, 4, 2))
    for measure in (found.beyond, found.outlying):
        assert measure(there).shape == (3, 4)
        assert measure(there[0, 0]).shape == ()
        assert measure(there[:0]).shape == (0, 4)
        assert measure(there)[2, 1] == measure(there[2, 1])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_is_infinitely_far(bad):
    found, there = extent(comb()), np.array([[0.0, 0.0], [0.0, bad]])
    assert found.beyond(there).tolist() == [0.0, np.inf]
    assert found.outlying(there)[1] == np.inf
    assert found.beyond(there[1]) == np.inf


@pytest.mark.parametrize(("xhat", "said"), [
    (np.full((2, 3, 2), np.nan), "a training latent is not finite"),
    (np.ones((2, 3, 2)), "6 training latents that are all the same"),
    (np.ones((1, 1, 2)), "1 training latents that are all the same"),
    (np.repeat(comb(1), 2, axis=0), "18 training latents of 2 runs, which do not differ"),
])
def test_training_latents_without_extent_are_refused(xhat, said):
    with pytest.raises(ValueError, match=said) as refusal:
        extent(xhat)
    assert "\n" not in str(refusal.value)


# Paths.

def test_a_step_is_compared_in_place_and_in_rate():
    """Along parallel runs: a trained step; one twice as long, to a trained place; one back; one
    beside the runs.
    """
    runs = comb()
    found = trained_paths(extent(runs, np.eye(2)), runs)
    assert found.ahead == 4.0           # half of eight steps
    at, step = np.array([3.0 * STEP, H]), np.array([STEP, 0.0])
    assert found.distance(at - step, at) < 1e-12
    assert found.distance(at - 2.0 * step, at) == pytest.approx(4.0 * STEP / H)
    assert found.distance(at + step, at) == pytest.approx(8.0 * STEP / H)
    beside = np.array([0.0, 0.5 * H])
    assert found.distance(at - step + beside, at + beside) == pytest.approx(0.5)
    assert found.distance(at, np.full(2, np.nan)) == np.inf


def test_latents_that_are_steps_apart_are_compared_by_the_step():
    runs = comb()
    found = trained_paths(extent(runs, np.eye(2)), runs, spacing=2.0)
    at, half = np.array([3.0 * STEP, H]), np.array([0.5 * STEP, 0.0])
    assert found.distance(at - half, at) < 1e-12
    assert found.distance(at - 2.0 * half, at) == pytest.approx(8.0 * 0.5 * STEP / H)


def test_latents_that_form_no_runs_have_no_paths():
    flat = comb().reshape(-1, 2)
    assert trained_paths(extent(flat, np.eye(2)), flat) is None
    assert trained_paths(extent(flat[:, None], np.eye(2)), flat[:, None]) is None
