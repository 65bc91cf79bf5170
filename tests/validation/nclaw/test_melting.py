"""Bodies that change their laws as they go, and whose laws they are."""


import numpy as np
import pytest

from mpm_ref.nclaw.bodies import copy_body
from mpm_ref.nclaw.study.compare import positions
from mpm_ref.scene import Box, build
from validation.common.scenes import with_
from validation.nclaw import gallery, melting, other_bodies
from validation.nclaw.environments import ENVIRONMENTS, environment
from validation.nclaw.states import collect
from validation.nclaw.tasks import unit_cube

STEPS, EVERY = 60, 20


@pytest.fixture
def scene():
    """A small cube of plasticine."""
    cube = environment("plasticine")
    few = with_(cube.body[0], sampling=with_(cube.body[0].sampling, counts=(4, 4, 4)))
    return unit_cube(with_(gallery.dessert(), body=(few,), steps=STEPS, every=EVERY), 10, 1)


def fluffy(body):
    """A body of next to no stress."""
    return other_bodies.body_with_laws(body, body.law._replace(mu=1e-3, lam=1e-3), body.flow)


def test_a_body_that_does_not_change_is_run_as_ever(scene):
    """But for round-off of another order of sums."""
    plain = [*positions(build(scene), tuple(map(copy_body, build(scene).bodies)))]
    same = [*melting.melting(build(scene), copy_body, copy_body)]
    assert len(plain) == len(same) == 1 + STEPS // EVERY
    assert np.allclose(plain, same, atol=1e-12)


def test_the_lowest_points_change_first(scene, monkeypatch):
    """Half-way, and all after the last step; how many is told by the step alone."""
    monkeypatch.setattr(melting, "FIRST", 0)
    monkeypatch.setattr(melting, "LAST", 40)
    seen = []

    def after(body):
        seen.append(body.id.copy())
        return copy_body(body)

    start, *_ = melting.melting(build(scene), copy_body, after)
    assert [len(ids) for ids in seen] == [32, 64]
    assert start[seen[0], 1].max() <= np.delete(start[:, 1], seen[0]).min()


def test_what_melts_moves_otherwise(scene, monkeypatch):
    monkeypatch.setattr(melting, "FIRST", -1)
    monkeypatch.setattr(melting, "LAST", 0)
    ends = [[*melting.melting(build(scene), copy_body, after)][-1] for after in (copy_body, fluffy)]
    assert np.abs(ends[1] - ends[0]).max() > 1e-4


def nowhere(body):
    """A body whose stress is not a number."""
    return other_bodies.body_with_laws(body, body.law._replace(mu=np.nan), body.flow)


def test_a_run_that_breaks_down_has_frames_of_nan(scene, monkeypatch):
    """As many as were asked for, from the first change on, and the step."""
    monkeypatch.setattr(melting, "FIRST", 10)
    monkeypatch.setattr(melting, "LAST", 30)
    count = 1 + STEPS // EVERY
    whole = collect(melting.melting(build(scene), copy_body, copy_body), count)
    found = collect(melting.melting(build(scene), copy_body, nowhere), count)
    assert whole.end is None
    assert found.end.step == 2 * EVERY
    assert len(found.x) == len(whole.x) == count
    assert np.array_equal(found.x[:2], whole.x[:2])
    assert np.isnan(found.x[2:]).all()


def test_each_of_several_bodies_melts_from_its_own_lowest_points_on(scene, monkeypatch):
    """Whatever their heights; their points keep their places in the positions."""
    monkeypatch.setattr(melting, "FIRST", 0)
    monkeypatch.setattr(melting, "LAST", 40)
    cube, seen = scene.body[0], []
    lower, upper = (
        with_(cube, name=name, shape=Box(lower=(0.3, y, 0.3), upper=(0.5, y + 0.2, 0.5)))
        for name, y in (("lower", 0.3), ("upper", 0.6)))

    def after(body):
        seen.append(body.id.copy())
        return copy_body(body)

    two = build(with_(scene, body=(lower, upper)))
    start, *_ = melting.melting(two, copy_body, after)
    assert start == pytest.approx(np.concatenate([body.particles.x for body in two.bodies]))
    first = seen[0]
    assert [np.count_nonzero(first < 64), np.count_nonzero(first >= 64)] == [32, 32]
    for ids in (np.arange(64), np.arange(64, 128)):
        assert (start[np.intersect1d(ids, first), 1].max()
                <= start[np.setdiff1d(ids, first), 1].min())


@pytest.mark.parametrize(("step", "share"), [(0, 0.0), (500, 0.0), (1000, 0.5), (2000, 1.0)])
def test_the_threshold_moves_as_in_the_release(step, share):
    assert melting.melted_points(step, 1000) == 1000 * share


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_materials_are_known_by_their_laws(name):
    assert other_bodies.environment_of(build(environment(name)).bodies[0]) == name


def test_parts_make_the_whole(scene):
    """Whatever their order."""
    body = copy_body(build(scene).bodies[0])
    body.particles.F[:] += np.arange(64)[:, None, None]
    which = np.random.default_rng(0).random(64) < 0.4
    again = melting.joined_body([melting.part(body, ~which), melting.part(body, which)])
    assert np.array_equal(again.particles.F, body.particles.F)
    assert np.array_equal(again.id, np.arange(64))
