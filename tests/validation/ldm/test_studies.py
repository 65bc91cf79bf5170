"""LDM's studies: which runs there are, what reduced runs of them are, how errors are measured."""

from math import cos, pi, sin

import numpy as np
import pytest

from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.study.dataset import simulate_snapshots
from mpm_ref.rom.study.errors import Squares
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import SCHEMES, RunOptions, ldm_run
from mpm_ref.scene import build
from mpm_ref.scene.records import Scheme
from validation.common.scenes import catalogue_scene, with_
from validation.ldm.references import nearest_state_errors, run_errors
from validation.ldm.studies import GRAVITY, PHI, POKE, POKES, STUDIES, TORSION, poked_again

STEPS = 4


@pytest.mark.parametrize("study", STUDIES.values(), ids=STUDIES)
def test_no_run_is_trained_on_and_tested(study):
    assert sorted((*study.train, *study.test)) == list(range(len(study.mu)))


def test_gravity_and_twist_are_set_in_the_scene():
    assert GRAVITY.scene(3.0).gravity == (0.0, 0.0, -3.0)
    bottom, top = TORSION.scene(0.1, 0.5).fixed
    assert top.motion.translation.rate == (0.0, 0.0, 0.1)
    assert top.motion.rotation.rate == 0.5
    assert bottom.motion.translation is None


def test_a_poke_goes_inwards_and_down_from_the_rim():
    theta = 0.7
    base, poke = POKES.scene(theta).fixed
    assert poke.region.center == pytest.approx((-0.1 * cos(theta), -0.1 * sin(theta), 0.4))
    rate = np.array(poke.motion.translation.rate)
    assert np.linalg.norm(rate) == pytest.approx(POKE)
    assert rate == pytest.approx(POKE * np.array([sin(PHI) * cos(theta), sin(PHI) * sin(theta),
                                                  cos(PHI)]))
    assert rate[2] < 0.0 < rate[:2] @ -np.array(poke.region.center[:2])
    assert base.until is None


def test_pokes_in_a_row_begin_when_a_single_run_would_end():
    scene = poked_again([0.0, 1.0, 2.0])
    single = POKES.scene(1.0)
    assert scene.steps == 3 * single.steps
    first, second, third = scene.fixed[1:]
    length = single.steps * single.dt
    assert [first.since, second.since, third.since] == pytest.approx([0.0, length, 2 * length])
    assert second.until - second.since == pytest.approx(single.fixed[1].until)
    assert second.motion.translation.start == second.since
    assert second.region.center == single.fixed[1].region.center


def test_errors_are_relative_to_the_distance_from_each_origin():
    X = np.random.default_rng(0).normal(size=(50, 3)) + 4.0
    sums, x = Squares(X), X + 0.3
    for off in (0.01, -0.02):
        sums.add(x + off, x)
    rms = np.linalg.norm([[0.01] * 3, [0.02] * 3])
    found = sums.errors
    for error, origin in zip(found, (0.0, X.mean(axis=0)), strict=False):
        expected = rms * np.sqrt(len(X)) / (np.sqrt(2.0) * np.linalg.norm(x - origin))
        assert error == pytest.approx(expected, rel=1e-12)
    assert found.displacement == pytest.approx(rms / np.sqrt(2.0 * 3 * 0.3**2))


@pytest.fixture(scope="module")
def fall():
    """(`FullModel`, x, F) of the first steps of the cylinder under the strongest gravity."""
    short = GRAVITY._replace(scene=lambda g: with_(GRAVITY.scene(g), steps=STEPS))
    full = short.run([29])
    return ldm_full_model(short.scene(*short.mu[29])), full.x[0], full.F[0]


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda s: " ".join(s))
@pytest.mark.slow
def test_a_run_on_its_own_modes_is_the_full_one(fall, scheme):
    """As many modes as there are states beside the one at rest hold all states and, as velocities
    are differences of states, all velocities; what is left is round-off, and the quadrature of
    Eulerian points: seen 5e-15 and 0.7 %.
    """
    one, x, F = fall
    own = modes(one.X, x, F, STEPS)
    found = run_errors([one], [x], own, RunOptions(*scheme), np.zeros(STEPS))
    assert nearest_state_errors(one.X, [x], own, np.zeros(STEPS)).displacement < 1e-12
    assert found.displacement < (1e-12 if scheme[0] == "lagrangian" else 0.02)


def test_the_start_is_the_body_at_rest_and_all_steps_are_given(fall):
    one, x, F = fall
    own = modes(one.X, x, F, 2)
    states = list(ldm_run(one, own, RunOptions(points=20), np.zeros(2)).states())
    assert len(states) == STEPS + 1
    (_, latent, report, _), (_, _, first, _) = states[:2]
    assert report is None
    assert abs(own.place(one.X, latent.xhat) - one.X).max() < 1e-12
    assert first.samples == 20


def test_samples_do_not_miss_the_end_that_is_held(fall):
    one, _, _ = fall
    near, = one.constrained_points(0.0)
    assert (one.X[near, 0] <= one.problem.dx).all()
    assert len(near) == np.sum(one.X[:, 0] <= one.problem.dx)


def test_other_draws_are_other_runs_and_the_same_draw_the_same(fall):
    one, x, F = fall
    own = modes(one.X, x, F, 3)
    a, b, c = (run_errors([one], [x], own, RunOptions(points=10), np.zeros(3), seed)
               for seed in (0, 0, 1))
    assert a == b != c


def test_the_affine_map_is_a_map_of_a_study_too(fall):
    """The interface asks for no more than `rom` says; a bar that bends is far from affine."""
    one, x, _ = fall
    found = run_errors([one], [x], Affine(3), RunOptions(), Affine(3).rest)
    assert 0.0 < found.origin < 0.1


def test_a_region_that_was_let_go_asks_for_no_samples():
    one = ldm_full_model(POKES.scene(0.0))
    assert [len(one.constrained_points(t)) for t in (0.0, 0.24, 0.26, 1.0)] == [2, 2, 1, 1]


@pytest.mark.parametrize(("scene", "said"), [
    (with_(GRAVITY.scene(1.0), scheme=with_(GRAVITY.scene(1.0).scheme, transfer="flip")), "flip"),
    (with_(GRAVITY.scene(1.0), scheme=with_(GRAVITY.scene(1.0).scheme, f_bar=True)), "averaged"),
    (with_(GRAVITY.scene(1.0), scheme=Scheme(transfer="pic", gimp=2.0)), r"\(gimp\)"),
    (with_(GRAVITY.scene(1.0), scheme=Scheme(transfer="pic", precision="single")), "single"),
    (catalogue_scene("nsf_metal"), "plastic flow"),
], ids=["transfer", "volumes", "splines", "precision", "plastic"])
def test_what_a_reduced_run_does_not_know_is_refused(scene, said):
    with pytest.raises(ValueError, match=said):
        ldm_full_model(scene)


def test_a_run_that_breaks_down_is_infinitely_off(fall):
    one, x, F = fall
    own = modes(one.X, x, F, 2)
    assert run_errors([one], [x], own, RunOptions(), np.full(2, np.nan)).origin == np.inf


@pytest.mark.parametrize("v", TORSION.mu[:, 0])
def test_all_pulls_drive_the_same_nodes_at_first(v):
    """The plane lies between layers of nodes, however far it goes in a step."""
    scene = TORSION.scene(v, 0.0)
    for region in scene.fixed[1:]:
        off = (region.region.point[2] + np.array([0.0, v * scene.dt])) / scene.dx
        assert np.ptp(np.ceil(off - 1e-9)) == 0.0


def test_angles_are_spread_evenly():
    assert np.diff(POKES.mu[:, 0]) == pytest.approx(pi / 18.0)
    assert np.diff(POKES.mu[list(POKES.train), 0]) == pytest.approx(pi / 6.0)


def test_one_point_in_so_many_is_recorded():
    problems = [build(with_(GRAVITY.scene(g), steps=2)) for g in (2.0, 3.0)]
    again = [build(with_(GRAVITY.scene(g), steps=2)) for g in (2.0, 3.0)]
    whole = simulate_snapshots(problems, [[2.0], [3.0]])
    thin = simulate_snapshots(again, [[2.0], [3.0]], every=9)
    for name in ("X", "m", "V0"):
        assert np.array_equal(getattr(whole, name)[::9], getattr(thin, name))
    for name in ("x", "F", "v"):
        assert np.array_equal(getattr(whole, name)[:, :, ::9], getattr(thin, name))
