"""Sources that sway: where their blocks enter, what is held of them, and what else knows it."""

from dataclasses import replace
from math import pi, sin

import numpy as np
import pytest
from problems import digest
from stream_scenes import DX, LENGTH, SPACING, SPEED, gravity, problem

from mpm_ref.core.boundary import Prescribed
from mpm_ref.core.grid import OutOfRange
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.preflight import misplaced
from mpm_ref.simulate import simulate
from mpm_ref.store.manifest import scene_hash
from mpm_ref.streams import EntryTimes, PlaceOfLastBlock, SourceSway, total_bodies

PERIOD = LENGTH / SPEED
A, F = (0.3, 0.04, -0.2), (1.0, 0.5, 1.7)       # [m], [1/s]
LEVEL = (0.3, 0.0, -0.2)                        # an amplitude across the stream alone [m]
CLOCKS = {"explicit": "end = 0.35", "fixed dt": "dt = 0.0043\nend = 0.35",
          "implicit": 'integrator = "hot"\nlongest = 0.021\nend = 0.35'}


def sway(d=2, amplitude=A, frequency=F):
    """The text of a sway."""
    return f"sway = {{ amplitude = {list(amplitude[:d])}, frequency = {list(frequency[:d])} }}"


def swaying(d, clock, more="hold = false", amplitude=A):
    """The problem of a stream from a source that sways, without forces."""
    return problem(d, f"{sway(d, amplitude)}, {more}", CLOCKS[clock])


def shift(k, d, amplitude=A):
    """Displacement (d,) of block k [m]."""
    return [a * sin(2.0 * pi * f * k * PERIOD) for a, f in zip(amplitude[:d], F[:d], strict=True)]


def fallen(t, d):
    """Displacement (d,) of a block in the time t [s] since it was due [m]."""
    return np.array([0.0, -SPEED * t, 0.0][:d])


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("d", [2, 3])
def test_blocks_enter_where_the_source_is_when_they_are_due(d, clock):
    """With a fixed dt they are moved by v times the delay since then, and no more."""
    one, first = swaying(d, clock), {}
    block = one.sources[0].block.particles.x

    def note(state, dt):
        body = state.bodies[0]
        for k in np.unique(body.id // len(block)):
            if k not in first:
                rows = body.id // len(block) == k
                order = np.argsort(body.id[rows])
                first[k] = state.t, body.particles.x[rows][order], body.particles.v[rows]

    list(simulate(one, on_step=note))
    assert sorted(first) == [0, 1, 2, 3]
    for k in (1, 2, 3):
        t, x, v = first[k]
        expected = block + (shift(k, d) + fallen(t - k * PERIOD, d))
        assert np.abs(x - expected).max() < 1e-15
        assert (v == [0.0, -SPEED, 0.0][:d]).all()          # none of the source's own
    assert np.ptp([shift(k, d) for k in range(4)], axis=0).min() > 0.03


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("d", [2, 3])
def test_a_stream_is_a_staircase_of_blocks(d, clock):
    """Without forces each block keeps its shift across the stream; along it there are no gaps."""
    one = swaying(d, clock, amplitude=LEVEL)
    *_, last = simulate(one)
    body, block = last.state.bodies[0], one.sources[0].block.particles.x
    assert len(body.id) == 4 * len(block)
    x = body.particles.x[np.argsort(body.id)].reshape(4, len(block), d)
    for k in range(4):
        expected = block + (shift(k, d, LEVEL) + fallen(last.t - k * PERIOD, d))
        assert x[k] == pytest.approx(expected, abs=1e-7)
    gaps = x[1:, :, 1].min(axis=1) - x[:-1, :, 1].max(axis=1)
    assert gaps == pytest.approx(SPACING, rel=1e-5)


@pytest.mark.parametrize("amplitude", [(0.0, 0.2), (0.0, -0.2)])
def test_a_sway_along_the_stream_parts_its_blocks(amplitude):
    one = problem(2, f"hold = false, {sway(2, amplitude)}", "end = 0.35")
    first, second = (one.sources[0].entering(k, PERIOD).particles.x[:, 1] for k in (0, 1))
    expected = amplitude[1] * sin(2.0 * pi * F[1] * PERIOD)
    assert second.min() - first.max() == pytest.approx(SPACING + expected, rel=1e-9)


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_block_is_held_until_it_has_left_the_place_where_it_entered(clock):
    """Under gravity it moves with v for a period, also while the source sways on. It enters seven
    cells from where it is sampled, so that its nodes are those of a block that does not sway.
    """
    amplitude = (7 * DX / sin(2.0 * pi * F[0] * PERIOD), 0.0)
    keys = CLOCKS[clock].replace("0.35", "0.2") + "\n" + gravity()
    one = problem(2, f"{sway(2, amplitude)}, length = {LENGTH}", keys)
    block, errors = one.sources[0].block.particles.x, {}
    top = np.flatnonzero(block[:, 1] > block[:, 1].max() - 0.5 * SPACING)

    def note(state, dt):
        body, late = state.bodies[0], state.t - PERIOD
        rows = np.isin(body.id, len(block) + top)
        if rows.any() and late < 0.75 * PERIOD:
            x = body.particles.x[rows][np.argsort(body.id[rows])]
            expected = block[top] + (shift(1, 2, amplitude) + fallen(late, 2))
            errors[late] = np.abs(x - expected).max()

    list(simulate(one, on_step=note))
    assert max(errors.values()) < 0.02 * SPACING
    assert 0.5 * 9.8 * max(errors)**2 > 0.8 * SPACING       # which a block falls that is free
    assert abs(shift(2, 2, amplitude)[0] - shift(1, 2, amplitude)[0]) > 0.2


def test_a_region_stands_where_the_last_block_entered():
    """It jumps as a block enters, and stays where the last one entered."""
    times = EntryTimes(0.1, 0.2, 3)
    place = PlaceOfLastBlock(SourceSway((1.0, 2.0), (0.25, 0.5)), times)
    for t, k in ((0.0, 0), (0.1, 0), (0.29, 0), (0.3, 1), (0.3 - 1e-12, 1), (0.49, 1), (0.7, 2),
                 (9.0, 2)):
        now = 0.1 + 0.2 * k
        assert place.value(t) == pytest.approx([sin(0.5 * pi * now), 2.0 * sin(pi * now)])
    (region,) = problem(2, sway(2) + ", stop = 0.2", "end = 0.5").conditions.prescribed
    assert region.motion.pose(0.15, 0.1, 2).v[0] == pytest.approx([0.0, -SPEED])
    assert region.region_motion.pose(0.15, 0.1, 2).center[0] == pytest.approx(shift(1, 2))
    assert region.region_motion.pose(9.0, 0.1, 2).center[0] == pytest.approx(shift(1, 2))


def test_regions_that_stand_or_follow_have_their_motions():
    motion = Motion(Steady((1.0, 0.0)))
    assert Prescribed(None, motion).region_motion is motion
    assert not Prescribed(None, motion, follows=False).region_motion.moves


@pytest.mark.parametrize("clock", CLOCKS)
def test_no_sway_has_the_bits_of_a_source_that_stands(clock):
    keys, zero = CLOCKS[clock] + "\n" + gravity(), (0.0, 0.0)
    runs = [problem(2, source, keys) for source in ("", sway(2, zero, zero))]
    assert runs[1].sources[0].sway is not None
    still, swayed = (digest(list(simulate(one))[-1].state.bodies) for one in runs)
    assert still == swayed


def test_a_swaying_run_goes_on_from_any_state():
    make = lambda: problem(2, sway(2), "end = 0.35\n" + gravity())  # noqa: E731
    *_, whole = simulate(make())
    for stop in range(1, whole.state.step, 9):
        state = None

        class Reached(Exception):
            pass

        def halt(at, dt, stop=stop):
            nonlocal state
            if at.step == stop:
                state = at
                raise Reached

        with pytest.raises(Reached):
            list(simulate(make(), on_step=halt))
        *_, last = simulate(make(), state)
        assert digest(last.state.bodies) == digest(whole.state.bodies)


def test_particles_of_the_whole_run_are_where_they_enter():
    for d in (2, 3):
        one = problem(d, sway(d) + ", stop = 0.35", "end = 0.5")
        (body,), (source,) = total_bodies(one), one.sources
        n, block = len(source.block.id), source.block.particles.x
        for k in range(source.blocks):
            moved = body.particles.x[k * n:(k + 1) * n] - block
            assert np.abs(moved - shift(k, d)).max() < 1e-15
        ends = source.extremes()
        assert ends.min(axis=0) == pytest.approx(block.min(axis=0) - np.abs(A[:d]))
        assert ends.max(axis=0) == pytest.approx(block.max(axis=0) + np.abs(A[:d]))
        assert not np.shares_memory(body.particles.x, block)


def test_a_sway_beyond_the_grid_is_refused_at_the_start():
    """At t = 0 its block is where it is sampled."""
    far = replace(problem(2, sway(2, (1e9, 0.0))), dx=1e-7)
    with pytest.raises(OutOfRange, match="expected coordinates of at most"):
        next(simulate(far))


WALL = """
[[collider]]
shape = {{ type = "half_space", point = [{x}, 0.0], normal = [-1.0, 0.0] }}
"""
TARGET = """
[[body]]
name = "target"
density = 1000.0
shape = { type = "box", lower = [0.75, 0.9], upper = [0.9, 1.0] }
material = { law = "fixed_corotated", E = 1e4, nu = 0.3 }
"""


def test_blocks_that_enter_in_a_solid_or_a_body_are_warned_of():
    """Also where the first one does not."""
    source = sway(2, LEVEL)
    assert not misplaced(problem(2, source, more=WALL.format(x=0.95)))
    (warning,) = misplaced(problem(2, source, more=WALL.format(x=0.7)))
    assert warning.startswith("block 1 of a source, which enters at t = 0.1 s: 12 of the "
                              "16 particles of body 'jet' start inside collider[0]")
    assert not misplaced(problem(2, "", more=TARGET))
    (warning,) = misplaced(problem(2, source, more=TARGET))
    assert warning.startswith("block 2 of a source, which enters at t = 0.2 s: bodies 'jet' "
                              "and 'target' overlap")
    later = misplaced(problem(2, source + ", start = 0.2", more=TARGET))
    assert later[0].startswith("bodies 'jet' and 'target' overlap")     # the first one


def test_runs_of_other_sways_have_other_hashes():
    sources = ("", sway(2), sway(2, LEVEL))
    runs = [replace(problem(2, source), source="") for source in sources]
    assert len({scene_hash(one) for one in runs}) == 3


@pytest.mark.parametrize(("amplitude", "frequency"), [
    ((0.1, np.nan), (1.0, 1.0)), ((0.1, 0.1), (1.0, -1.0)), ((0.1, 0.1), (1.0, np.inf)),
    ((0.1, 0.1), (1.0,))])
def test_what_is_no_sway_is_refused(amplitude, frequency):
    with pytest.raises(ValueError, match="expected finite numbers, and for each amplitude"):
        SourceSway(amplitude, frequency)
