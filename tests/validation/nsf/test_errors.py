"""Fields of NSF's studies and reduced runs on them, at the coarse grid of the quick profile."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_toys import Records

from mpm_ref.core.grid import OutOfRange
from mpm_ref.rom.fields.elastic import ElasticModes
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.samples import cell_samples
from validation.nsf import errors, reduced_runs
from validation.nsf.studies import bread, cake, jelly, metal, sand, toothpaste

TEST = 0.45


@pytest.fixture(scope="module")
def cube():
    """The jelly cube at half the resolution."""
    return reduced_runs.fit_study(jelly(2))


def test_coarse_grids_keep_particles_to_a_cell_and_waves_to_a_step():
    fine, coarse = jelly().run(0.3), jelly(2).run(0.3)
    assert (coarse.dx, coarse.dt, coarse.steps) == (2 * fine.dx, 2 * fine.dt, fine.steps // 2)
    assert [body.sampling.count for body in coarse.body] == [500, 750]
    assert coarse.body[0].velocity.linear[0] == 0.3


def test_a_longer_study_has_more_steps_of_the_scene():
    assert (sand().run(30.0).steps, sand(3).run(30.0).steps) == (300, 100)
    assert len(sand().train) == 16
    assert not set(sand().train) & set(sand().test)


def test_cake_is_sampled_in_the_middle_and_by_fewer_later():
    study = cake(3, train=3)
    one = nsf_full_model(study.run(15.0))
    early, late = study.chosen(one, study.samples, 0)
    assert (len(early.points), len(late.points)) == (700, 400)
    assert (early.since, late.since) == (0.0, pytest.approx(0.256, rel=0.01))
    middle = 0.5 * (one.X.min(axis=0) + one.X.max(axis=0))
    away = np.linalg.norm((one.X - middle)[:, :2], axis=1) / one.problem.dx
    assert away[early.points].max() <= 2.0 < away.max()
    everything, = study.chosen(one, len(one.X), 0)
    assert np.array_equal(everything.points, np.arange(len(one.X)))


def test_the_map_alone_does_not_know_the_stress(cube):
    alone = cube._replace(map_alone=True)
    assert isinstance(alone.fields_of_run(TEST), ElasticModes)
    assert alone.errors(TEST, 50).errors.origin > 2.0 * cube.errors(TEST, 50).errors.origin


def test_snapshots_are_a_divisor_of_the_steps_apart():
    for study in (bread(3, train=3), metal(2), toothpaste(3)):
        assert study.run(study.test[0]).steps % study.spacing == 0


def test_reduced_runs_beat_the_nearest_run_and_not_the_nearest_states(cube):
    every = cube.errors(TEST, len(cube.runs.X))
    nearest, taken = cube.nearest_state_errors(TEST), cube.nearest_run_errors(TEST)
    assert nearest.origin <= every.errors.origin < 0.1 * taken.origin
    assert every.errors.origin < every.errors.centroid < every.errors.displacement
    assert 0.0 < every.stress < 0.5
    assert every.points == len(cube.runs.X)


def test_the_next_run_is_the_one_of_the_nearest_value(cube):
    """Runs are of 0.3, 0.4 and 0.5: that of 0.4 is not off itself."""
    itself = cube.runs._replace(x=cube.runs.x[1:2])
    for value in (0.36, 0.44):
        assert cube._replace(tests={value: itself}).nearest_run_errors(value).origin == 0.0


def test_tests_that_are_a_training_run_are_counted(cube):
    itself = cube.runs._replace(x=cube.runs.x[1:2])
    study, run = cube.study._replace(test=(0.36, TEST)), Records()
    errors.record_nearest(run, "a", cube._replace(study=study, tests=cube.tests | {0.36: itself}))
    value, note = run["a.next_run"]
    assert "in 1 of 2 tests it is the very same run" in note
    assert value == pytest.approx(50.0 * cube.nearest_run_errors(TEST).origin)
    assert "very same" not in run["a.nearest"][1]


def test_the_affine_field_is_worth_its_modes(cube):
    without = reduced_runs.refit(cube, cube.study.sizes._replace(C=0), follows=False)
    some = [one.errors(TEST, 50).errors.origin for one in (without, cube)]
    assert some[0] > 5.0 * some[1]
    assert without.xhat == pytest.approx(cube.xhat, abs=1e-9)


def test_draws_differ_and_repeat(cube):
    a, b, again = (cube.errors(TEST, 40, draw) for draw in (0, 1, 0))
    assert a._replace(misfit=None) == again._replace(misfit=None)      # NaN of no weights
    assert a.errors != b.errors


def test_longer_steps_are_compared_where_times_meet(cube):
    longer = cube.errors(TEST, 50, dt_factor=1.5)
    assert longer.errors.origin < 0.0035       # 0.0038 where states between levels are compared


def test_a_run_that_breaks_down_is_infinitely_off(cube, monkeypatch):
    def broken(*_):
        raise OutOfRange("far away")
        yield

    monkeypatch.setattr(reduced_runs, "nsf_run", lambda *_: SimpleNamespace(states=broken))
    found = cube.errors(TEST, 50)
    assert found.errors == (np.inf, np.inf, np.inf)
    assert found.stress == np.inf
    assert np.isnan(found.points)


def test_samples_that_weights_keep_are_counted(cube):
    one = nsf_full_model(cube.study.run(TEST))
    chosen, = cube.study.chosen(one, 50, 0, cube.fields)
    found, drawn = (cube.errors(TEST, 50, weighted=weighed) for weighed in (True, False))
    assert (found.samples, found.misfit) == (len(chosen.points), chosen.misfit)
    assert found.samples < drawn.samples == 50
    assert 1e-3 < found.misfit < 1.0
    assert np.isnan(drawn.misfit)
    later = cube._replace(study=cube.study._replace(later=20))
    both = later.study.chosen(one, 50, 0, cube.fields)
    found = later.errors(TEST, 50, weighted=True)
    assert found.samples == np.mean([len(own.points) for own in both])
    assert found.misfit == both[1].misfit > both[0].misfit


def test_samples_of_a_study_may_be_those_of_cells(cube):
    one = nsf_full_model(cube.study.run(TEST))
    chosen, = cube.study._replace(by_cell=True).chosen(one, 5, 1, cube.fields)
    expected = cell_samples(cube.fields, one.problem, len(one.X), 5, 1)
    assert np.array_equal(chosen.points, expected.points)
    assert np.array_equal(chosen.weights, expected.weights)
    plain, = cube.study._replace(by_cell=True).chosen(one, 5, 1)
    assert plain.weights is None


def test_records_of_weighted_samples_say_how_many_there_are(cube):
    records = Records()
    row, = errors.record_weighted(records, "nsf.jelly.error", cube, 20, (0,))
    found = cube.errors(TEST, 20, weighted=True)
    assert row[errors.COLUMNS.index("kept")] == found.samples
    value, note = records["nsf.jelly.error.modes.weighted"]
    assert value == 100.0 * found.errors.origin
    assert (f"at most 20 samples with weights by cubature, of random candidates; {found.samples:g} "
            f"kept, whose weights leave {found.misfit:.2g} of the modes' products") in note


def test_rows_are_told_by_their_columns(cube):
    rows = errors.error_rows(cube, "modal", 50, (0, 1))
    assert len(rows) == 2
    assert all(len(row) == len(errors.COLUMNS) for row in rows)
    assert errors.mean(rows, "samples") == 50.0
    assert cube.scale.startswith("1250 particles, 60 steps, all kept, 3 runs and 1 test, dx "
                                 "and dt 2 times as long; r = ")


def test_steps_are_told_beside_the_states_that_are_kept(cube):
    """Of a run of which not every state is kept, and of several tests."""
    some = next(iter(cube.tests.values()))
    kept = some._replace(x=some.x[:, ::6], tau=some.tau[:, ::6], C=some.C[:, ::6])
    study = cube.study._replace(every=12, test=(0.45, 0.35))
    one = cube._replace(study=study, tests={0.45: kept, 0.35: kept})
    assert one.size.startswith("1250 particles, 60 steps, one in 6 kept, 3 runs and 2 tests, ")
