"""Quadrature points of another sampling, and samples that are kept or chosen."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from rom_toys import cloud

from mpm_ref.materials.fixed_corotated import FixedCorotated
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.latent import Latent, start_state
from mpm_ref.rom.quadrature.lagrangian import Resampled, lagrangian
from mpm_ref.rom.sampling import PER_GROUP, pivoted
from mpm_ref.rom.step import ldm_stepper
from mpm_ref.rom.study import samples as choice
from mpm_ref.rom.study.full_model import ldm_full_model, signed_distance
from mpm_ref.rom.study.methods import ldm_reduced_run
from mpm_ref.rom.study.run import ReducedRun, RunOptions, ldm_model, ldm_run
from mpm_ref.rom.study.samples import SampleSet, boundary_groups, ldm_sampler
from mpm_ref.rom.study.tables import MapRunTable
from mpm_ref.scene import Box, Cylinder, Difference, Union
from validation.common.scenes import with_
from validation.ldm.networks import trained
from validation.ldm.studies import GRAVITY, POKES, TORSION

DX = 0.11


@pytest.fixture(scope="module")
def torsion():
    """The block, pulled and twisted, four steps."""
    return ldm_full_model(with_(TORSION.scene(0.3, 1.0), steps=4))


def test_another_sampling_that_is_the_same_gives_the_same_cloud(d, rng):
    X, map, m = cloud(d, 400), Affine(d), rng.uniform(1.0, 2.0, 400)
    own = lagrangian(X, m, m, DX, 2)
    samples = rng.choice(400, 3, replace=False)
    xhat = map.rest
    a, b = (one.cloud(map, xhat, samples) for one in (own, Resampled(X, own)))
    assert all(np.array_equal(*pair) for pair in zip((*a.points, a.m, a.V0), (*b.points, b.m, b.V0),
                                                     strict=True))


def test_its_points_are_as_many_however_many_material_points_there_are(d, rng):
    X, map = cloud(d, 400), Affine(d)
    coarse = lagrangian(cloud(d, 200, seed=1), np.ones(200), np.ones(200), DX, 2)
    xhat = map.rest
    few = Resampled(X, coarse).cloud(map, xhat, np.arange(3))
    many = Resampled(np.vstack([X, X + 1e-3]), coarse).cloud(map, xhat, np.arange(3))
    assert few.report == many.report
    assert 0 < few.report["points"] < 200


def test_another_sampling_has_the_body_s_mass(torsion):
    quadrature = ldm_model(torsion, Affine(3), RunOptions("resampled", per_cell=3)).quadrature
    assert quadrature.other.m.sum() == pytest.approx(torsion.m.sum(), rel=1e-12)
    assert len(quadrature.other.X) != len(torsion.X)


def test_nodes_beyond_the_other_sampling_move_with_the_samples(d):
    """A body that moves as one does so where half of it has no quadrature points."""
    X, map = cloud(d, 200), Affine(d)
    half = X[X[:, 0] < 0.5]
    other = lagrangian(half, np.ones(len(half)), np.ones(len(half)), DX, 2)
    vhat = np.zeros(map.r)
    vhat[d] = 1.0                           # along the first axis
    model = ldm_stepper(map, Resampled(X, other), FixedCorotated(3e3, 4e3), np.zeros(d))
    after, report = model.step(start_state(map.rest, vhat), np.arange(200), 0.0, 1e-3)
    assert report.residual < 1e-9
    assert after.vhat == pytest.approx(vhat, abs=1e-9)


def test_a_run_with_another_sampling_is_near_the_one_with_material_points():
    """They differ by their quadrature alone; one point to a cell is too few."""
    trained_map = trained("gravity-r4")
    map, one = trained_map.field, ldm_full_model(with_(GRAVITY.scene(5.0), steps=10))
    def end(way):
        *_, last = ldm_run(one, map, way, trained_map.rest).states()
        return map.place(one.X, last.latent.xhat) - one.X

    material = end(RunOptions())
    off = [np.linalg.norm(end(RunOptions("resampled", per_cell=k)) - material) for k in (1, 2)]
    size = np.linalg.norm(material)
    assert 0.0 < off[1] < 0.1 * size
    assert off[0] > 3.0 * off[1]


def test_single_precision_and_near_preimages_change_little():
    """Far less than the displacement, and not nothing."""
    model, one = trained("gravity-r4"), ldm_full_model(with_(GRAVITY.scene(5.0), steps=6))
    paper = RunOptions("eulerian", points=30)
    def end(**how):
        *_, last = ldm_run(one, model.field, paper._replace(**how), model.rest).states()
        return model.field.place(one.X, last.latent.xhat) - one.X

    exact, near, single = (end(**how) for how in (
        {}, {"preimage_tolerance": 1e-2}, {"preimage_tolerance": 1e-2, "precision": "single"}))
    size = np.linalg.norm(exact)
    assert 0.0 < np.linalg.norm(near - exact) < 1e-2 * size
    assert 0.0 < np.linalg.norm(single - near) < 1e-4 * size


@pytest.mark.parametrize(("way", "said"), [
    (RunOptions(precision="half"), r"precision = 'half': expected double or single"),
    (RunOptions(precision="single"), r"learned maps alone have it, this is one of Affine"),
    (RunOptions("eulerian", precision="single"), r"learned maps alone have it"),
])
def test_precision_that_there_is_not(torsion, way, said):
    with pytest.raises(ValueError, match=said):
        ldm_model(torsion, Affine(3), way)


def test_preimages_nearer_than_single_precision_tells_are_refused(torsion):
    map = trained("gravity-r4").field
    with pytest.raises(ValueError, match="preimage_tolerance = 1e-09 dx in single precision:"):
        ldm_model(torsion, map, RunOptions("eulerian", precision="single"))
    assert ldm_model(torsion, map, RunOptions(precision="single")).field.g.net.W.dtype == np.float32
    assert ldm_model(torsion, map, RunOptions()).field.g is map


def test_pivots_are_the_rows_that_tell_the_coordinates(rng):
    G = 1e-3 * rng.normal(size=(50, 3, 4))
    for k, p in enumerate((7, 12, 30, 44)):
        G[p, k % 3, k] = 1.0
    assert set(pivoted(G, 4)) == {7, 12, 30, 44}


def test_pivots_are_not_the_largest_rows_but_different_ones():
    G = np.zeros((6, 1, 3))
    G[:4, 0, 0] = 10.0, 9.0, 8.0, 7.0
    G[4, 0, 1], G[5, 0, 2] = 2.0, 1.0
    assert set(pivoted(G, 3)) == {0, 4, 5}


@pytest.mark.parametrize("count", [1, 3, 10, 50, 60])
def test_pivots_are_of_the_count_and_different(count, rng):
    found = pivoted(rng.normal(size=(50, 3, 4)), count)
    assert len(set(found.tolist())) == len(found) == min(count, 50)


def test_chosen_samples_are_better_conditioned_than_drawn_ones(rng):
    G = rng.normal(size=(300, 3, 6)) * rng.exponential(size=(300, 1, 1))
    def condition(chosen):
        return np.linalg.cond(G[chosen].reshape(-1, 6))

    drawn = [condition(rng.choice(300, 4, replace=False)) for _ in range(20)]
    assert condition(pivoted(G, 4)) < np.median(drawn)


@pytest.mark.parametrize("how", ["kept", "pivoted"])
def test_samples_that_are_kept_stay_and_hold_the_boundaries(torsion, how):
    map = Affine(3)
    pick = ldm_sampler(torsion, map, RunOptions(points=20, samples=how), map.rest, 3)
    assert np.array_equal(pick(0.0, None).points, pick(0.01, None).points)
    assert len(set(pick(0.0, None).points.tolist())) == 20
    for near in torsion.boundary_points:
        assert np.isin(pick(0.0, None).points, near).sum() >= PER_GROUP


class Bulge(NamedTuple):
    """A map of which only points near a height do anything: the first latent coordinate."""

    dim = r = 3

    def derivatives(self, X, xhat):
        return X, None, np.exp(-1e4 * (X[:, 2] - xhat[0]) ** 2)[:, None, None] * np.eye(3)


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_samples_are_pivoted_where_the_body_starts_and_hold_the_boundaries_beside(torsion, share):
    low, high = torsion.X[:, 2].min(), torsion.X[:, 2].max()
    height = low + share * (high - low)
    pick = ldm_sampler(torsion, Bulge(), RunOptions(points=20, samples="pivoted"),
                       np.full(3, height), 3)
    chosen = pick(0.0, None).points
    held = sum(np.isin(chosen, near).sum() for near in torsion.boundary_points)
    close = abs(torsion.X[chosen, 2] - height) < 0.1 * (high - low)
    assert len(chosen) == 20
    assert held == len(torsion.boundary_points) * PER_GROUP == 20 - close.sum()


def test_points_that_two_regions_hold_are_counted_once(torsion):
    both = torsion._replace(boundary_points=2 * (torsion.boundary_points[0][:PER_GROUP],))
    chosen = ldm_sampler(both, Affine(3), RunOptions(points=20, samples="pivoted"), Affine(3).rest,
                         3)(0.0, None).points
    assert len(set(chosen.tolist())) == len(chosen) == 20
    assert np.isin(both.boundary_points[0], chosen).all()


@pytest.mark.parametrize("how", ["redrawn", "kept", "pivoted"])
@pytest.mark.parametrize(("points", "said"), [
    (3, "3 samples in 3 axes for 12 latent coordinates: expected at least 4"),
    (10**6, "1000000 samples of .* points: expected 1"),
])
def test_samples_that_do_not_suffice_are_refused_however_they_are_chosen(
        torsion, how, points, said, monkeypatch):
    monkeypatch.setattr(choice, "ENOUGH", 10**7)
    with pytest.raises(ValueError, match=said):
        ldm_sampler(torsion, Affine(3), RunOptions(points=points, samples=how), Affine(3).rest,
                    3)(0.0, None)


def study_of(options):
    return SimpleNamespace(tables=SimpleNamespace(run=MapRunTable(**options._asdict())))


@pytest.mark.parametrize(("points", "count"), [(20, 20), (None, 1757)])
def test_no_more_are_pivoted_than_are_looked_at(torsion, points, count, monkeypatch):
    """Nor are fewer given than were asked for; the command says so before a run."""
    way, map = RunOptions(points=points, samples="pivoted"), Affine(3)
    monkeypatch.setattr(choice, "ENOUGH", 19)
    for ask in (lambda: ldm_sampler(torsion, map, way, map.rest, 3),
                lambda: ldm_reduced_run(study_of(way), torsion, map, map.rest)):
        with pytest.raises(ValueError, match=f"{count} samples that are pivoted: .* at most 19;"):
            ask()
    monkeypatch.setattr(choice, "ENOUGH", count)
    sampler = ldm_sampler(torsion, map, way._replace(points=20), map.rest, 3)
    assert len(sampler(0.0, None).points) == 20


def test_samples_of_a_region_are_forced_while_it_holds():
    """The patch that pokes lets go at 0.25 s; few points are near it."""
    one, map = ldm_full_model(POKES.scene(0.0)), Affine(3)
    pick = ldm_sampler(one, map, RunOptions(points=20), map.rest, 3)
    patch = one.constrained_points(0.0)[1]
    early, late = ([np.isin(pick(t, None).points, patch).sum() for _ in range(5)]
                   for t in (0.0, 1.0))
    assert min(early) >= PER_GROUP
    assert min(late) < PER_GROUP


def test_samples_that_are_redrawn_change(torsion):
    map = Affine(3)
    pick = ldm_sampler(torsion, map, RunOptions(points=20), map.rest, 3)
    assert not np.array_equal(pick(0.0, None).points, pick(0.0, None).points)


@pytest.mark.parametrize(("way", "said"), [(RunOptions("lagrange"), "quadrature = 'lagrange'"),
                                           (RunOptions(points=20, samples="best"),
                                            "samples = 'best'")])
def test_ways_that_there_are_not_are_refused(torsion, way, said):
    with pytest.raises(ValueError, match=said):
        next(ldm_run(torsion, Affine(3), way, Affine(3).rest).states())


def test_distances_from_shapes_made_of_others():
    ball = Cylinder(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 2.0), radius=1.0)
    box = Box(lower=(0.0, -1.0, 0.0), upper=(3.0, 1.0, 2.0))
    X = np.array([[0.5, 0.0, 1.0], [2.5, 0.0, 1.0], [-0.5, 0.0, 1.0], [-2.0, 0.0, 1.0]])
    assert signed_distance(X, Union(shapes=(ball, box))) == pytest.approx([-0.5, -0.5, -0.5, 1.0])
    assert signed_distance(X, Difference(shape=ball, minus=(box,))) == pytest.approx([0.5, 1.5,
                                                                                      -0.5, 1.0])


@pytest.mark.parametrize(("points", "bound"), [(None, 0), (9, 0), (19, 0), (20, 2), (50, 2)])
def test_boundaries_take_at_most_half_of_the_samples(torsion, points, bound):
    assert len(boundary_groups(torsion, RunOptions(points=points), 0.0)) == bound


def test_every_step_is_told_its_time_and_goes_on_from_the_last():
    run = ReducedRun(CountedLatents(), None, lambda xhat: SampleSet, 0.25, 3)
    first = (Latent(0), None)
    start, *states = run.states([first])
    assert start == (0.0, *first, None)
    assert [(state.t, state.latent.xhat, state.report) for state in states] == [
        (0.25 * (k + 1), k + 1, (k, k, 0.25 * k, 0.25, None)) for k in range(3)]


class CountedLatents:
    """A stepper that counts steps, and reports what it is given."""

    def step(self, latent, samples, t, dt, weights):
        return Latent(latent.xhat + 1), (latent.xhat, samples.xhat, t, dt, weights)
