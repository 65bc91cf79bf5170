"""The tower: its size, and the race of full and reduced models."""

from time import sleep
from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.kinematics import NoBody
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions, ldm_run
from mpm_ref.scene import build
from validation.common.scenes import with_
from validation.ldm import tower
from validation.ldm.studies import TOWER, latin_twice, refined
from validation.ldm.timing import (
    COLUMNS,
    SteppedFullRun,
    SteppedReducedRun,
    StepTime,
    TimedRun,
    full_step,
    median,
    race,
    timed,
)

EXACT = Affine(3), Affine(3).rest       # a map that is exact for affine motions
PRINTED = 3076115 * (0.48 / 3) ** 3     # [m^3]: points times volumes (LDM-tab2-sampling, LDM-X8)


@pytest.fixture
def small():
    """A tower of few points and steps."""
    return with_(refined(TOWER.scene(0.7, 0.3, -0.8), 2.88, 2), steps=3)


def test_the_tower_has_the_printed_volume():
    body = build(TOWER.scene(0.7, 0.3, -0.8)).bodies[0]
    assert body.particles.V0.sum() == pytest.approx(PRINTED, rel=0.02)


def test_parameters_are_within_their_ranges_and_fill_them():
    low, high = np.array((0.6, 0.0, -np.pi / 3)), np.array((0.8, np.pi / 2, -np.pi / 6))
    for numbers in (TOWER.train, TOWER.test):
        share = (TOWER.mu[list(numbers)] - low) / (high - low)
        strata = np.sort((share * len(numbers)).astype(int), axis=0)
        assert (strata == np.arange(len(numbers))[:, None]).all()


def test_parameters_are_those_of_scipy():
    qmc = pytest.importorskip("scipy.stats.qmc")
    rng, low, high = np.random.default_rng(5), (0.0, 1.0), (2.0, 1.5)
    expected = [qmc.scale(qmc.LatinHypercube(2, rng=rng).random(n), low, high) for n in (7, 3)]
    assert np.array_equal(latin_twice(((0.0, 2.0), (1.0, 1.5)), 7, 3, 5), np.vstack(expected))


def test_the_top_moves_as_it_is_told():
    _, top = TOWER.scene(0.5, 0.0, -np.pi / 6).fixed
    assert top.motion.translation.rate == pytest.approx((0.5 * np.cos(np.pi / 6), 0.0, -0.25))


def test_a_race_measures_every_way(small):
    ways = [RunOptions("resampled", points=30), RunOptions("eulerian", points=30)]
    full, fastest, found = race(small, EXACT, ways, 3)
    assert min(full) > 0.0 < min(fastest)
    for one, way in zip(found, ways, strict=True):
        assert one.options == way
        assert min(one.spent) > 0.0
        assert 0 < one.points < 20000
        assert 0.0 < one.errors.origin < 0.1


def test_a_run_that_breaks_down_has_no_error(small, monkeypatch):
    sound, lost = (RunOptions("resampled", points=n) for n in (30, 29))

    def breaking(one, g, options, rest):
        def states():
            for k, state in enumerate(ldm_run(one, g, options, rest).states()):
                if options == lost and k == 2:
                    raise NoBody("none is left")
                yield state

        return SimpleNamespace(states=states)

    monkeypatch.setattr("validation.ldm.timing.ldm_run", breaking)
    *_, (broken, fine) = race(small, EXACT, [lost, sound], 2)
    assert broken.errors.origin == broken.spent.wall == np.inf
    assert np.isfinite(fine.errors.origin)


def test_a_race_with_too_few_samples_is_a_mistake(small):
    with pytest.raises(ValueError, match="2 samples in 3 axes for 12 latent coordinates"):
        race(small, EXACT, [RunOptions("resampled", points=2)], 1)


def test_full_and_reduced_steps_are_made_in_turn(small, monkeypatch):
    """The full model, the same with the fastest transfer, and each reduced run, until the end."""
    order = []

    def record_step(step, name):
        def recorded(self, *given):
            order.append(name(self))
            return step(self, *given)
        return recorded

    monkeypatch.setattr(SteppedFullRun, "step", record_step(
        SteppedFullRun.step, lambda run: run.problem.scheme.transfer))
    monkeypatch.setattr(SteppedReducedRun, "step", record_step(
        SteppedReducedRun.step, lambda run: run.options.points))
    race(small, EXACT, [RunOptions("resampled", points=n) for n in (30, 29)], small.steps)
    assert order == [small.scheme.transfer, "mls", 30, 29] * small.steps


def test_times_of_a_race_are_medians_of_steps_in_motion(small, monkeypatch):
    """Of the transfers each its own; the step from rest, here a slow one, counts as one of many."""
    spent = {small.scheme.transfer: iter((90.0, 8.0, 7.0)), "mls": iter((80.0, 4.0, 3.0))}

    def step(self):
        wall = next(spent[self.problem.scheme.transfer])
        self.spent.append(StepTime(wall, 2.0 * wall))

    monkeypatch.setattr(SteppedFullRun, "step", step)
    full, fastest, _ = race(small, EXACT, [], 3)
    assert (full, fastest) == ((8.0, 16.0), (4.0, 8.0))


def test_a_full_step_is_measured(small):
    assert min(full_step(small, 2)) > 0.0


def test_tracked_points_are_in_their_own_order(small):
    full = SteppedFullRun(small)
    start = full.positions(7)
    full.step()
    assert np.array_equal(start, ldm_full_model(small).X[::7])
    assert np.abs(full.positions(7) - start).max() < 0.1


def test_time_is_counted_while_a_step_runs():
    def idle():
        sleep(0.02)
        return "done"

    found, spent = timed(idle)
    assert found == "done"
    assert spent.wall >= 0.02 > spent.cpu >= 0.0
    assert median([StepTime(1.0, 5.0), StepTime(9.0, 6.0), StepTime(2.0, 40.0)]) == (2.0, 6.0)


def test_a_row_tells_the_way_in_order():
    one = TimedRun(tower.FAST._replace(points=25), StepTime(0.1, 0.2), 300,
                   PositionErrors(1.0, 2.0, 3.0))
    row = dict(zip(COLUMNS, one.row, strict=True))
    assert (row["quadrature"], row["points"], row["precision"]) == ("eulerian", 25, "single")
    assert (row["wall"], row["cpu"]) == (0.1, 0.2)
    assert (row["quadrature_points"], row["origin"]) == (300, 1.0)
    assert one._replace(options=RunOptions()).row[2] == "all"


def test_ways_have_names_of_their_own():
    names = [TimedRun(way, None, 0, None).label for way in tower.all_options((25, 50))]
    assert names[:2] == ["lagrangian-nonlinear-25", "lagrangian-nonlinear-50"]
    assert "eulerian-linear-25-transported-0.01-single" in names
    assert len(set(names)) == len(names)


def test_what_the_paper_prints_is_of_its_options_and_the_fastest_sound_run_is_cheap():
    def row(quadrature, points, wall, close=1e-9, error=1.0):
        way = RunOptions(quadrature, "linear", points, preimage_tolerance=close)
        raced = TimedRun(way, StepTime(wall, 0.0), 1000 * points, PositionErrors(error, 0.0, 0.0))
        times = 8.0, 4.0, 24 * wall, 4.0 / wall, 8.0 / wall
        return dict(zip(tower.OWN, (7, *raced.row, *times), strict=True))

    said = {}
    run = SimpleNamespace(profile="standard",
                          record=lambda name, value, **words: said.update({name: value}))
    tower.printed(run, [row("eulerian", 25, 0.5), row("eulerian", 25, 0.25, 1e-2),
                        row("eulerian", 25, 0.03, 1e-2, 2.0), row("eulerian", 50, 0.1),
                        row("resampled", 25, 0.01)])
    assert said == {"ldm.fig16.speedup": 8.0, "ldm.abstract.speedup": 8.0,
                    "ldm.fig16.realtime": 12.0,
                    "ldm.fig16.speedup.cheap": 16.0, "ldm.abstract.speedup.cheap": 16.0,
                    "ldm.fig16.realtime.cheap": 6.0,
                    "ldm.sec5_4.quadrature_points": 50000}
