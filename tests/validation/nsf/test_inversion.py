"""NSF: Gauss-Newton and its first step alone, on a small study."""

import pytest
from small_toys import Records

from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nsf import inversion, reduced_runs
from validation.nsf.studies import jelly

STUDY = jelly(4)._replace(train=(0.3, 0.5), test=(0.35, 0.4), samples=40,
                          sizes=Sizes(r=3, modes=8, tau=12, C=12, smoothing=1e-4))


@pytest.fixture(scope="module")
def one():
    """The small study."""
    return reduced_runs.fit_study(STUDY)


@pytest.mark.parametrize("faster", [1.0, 1.5])
def test_gauss_newton_is_how_runs_are_usually_inverted(one, faster):
    runs = inversion.runs_of(one, "nonlinear", faster, (0, 2))
    assert list(runs) == [(0.35, 0), (0.35, 2), (0.4, 0), (0.4, 2)]
    for (value, draw), own in runs.items():
        assert own.errors == one.errors(value, 40, draw, faster).errors
    found = runs[0.4, 0]
    scene = nsf_full_model(STUDY.run(0.4))
    plan = FieldRunOptions(STUDY.chosen(scene, STUDY.samples, 0), faster)
    taken = [report.iterations for _, _, report, _ in
             nsf_run(scene, one.fields_of_run(0.4), plan, one.rest).states()
             if report is not None]
    assert found.iterations == tuple(taken)
    assert min(taken) > 1
    found = found._replace(iterations=(8, 3, 4, 4, 9))
    assert inversion.iteration_quantiles(found) == [3.0, 4.0, 9.0]


def test_its_first_step_alone_is_another_run(one):
    found, usual = (inversion.runs_of(one, kind, 1.0, (0,))[0.4, 0]
                    for kind in ("linear", "nonlinear"))
    assert inversion.iteration_quantiles(found) == [1.0, 1.0, 1.0]
    assert found.errors.origin == pytest.approx(usual.errors.origin, rel=0.3)
    assert found.errors != usual.errors


def test_errors_and_iterations_are_recorded(one, tmp_path, monkeypatch):
    monkeypatch.setattr(inversion, "jelly", lambda coarser: STUDY)
    monkeypatch.setattr(inversion, "metal", lambda coarser, train: STUDY._replace(test=(0.4,)))
    monkeypatch.setattr(inversion, "fit_study", lambda study: one._replace(study=study))
    setting = RunSetting("quick", tmp_path, targets=targets.load())
    assert not run_all([inversion.inversion.experiment], setting)
    found = ProfileResults(tmp_path)
    table = found.table("nsf.inversion", "runs")
    assert list(zip(table["scene"], table["value"], table["inversion"], table["faster"],
                    strict=True)) == [
        (name, value, kind, faster) for name, values in (("jelly", (0.35, 0.4)), ("metal", (0.4,)))
        for kind in ("nonlinear", "linear") for faster in (1.0, 1.5) for value in values]
    expected = inversion.runs_of(one, "linear", 1.5, (0,))[0.4, 0]
    last = [table[name][-1] for name in inversion.COLUMNS[5:]]
    assert last == pytest.approx([*expected.errors, expected.stress, 1.0, 1.0, 1.0])
    records = {r.target: r for r in found.records("nsf.inversion")}
    assert records["nsf.inversion.jelly.linear.x1.error"].value == pytest.approx(
        50.0 * sum(table["origin"][4:6]))
    _, medians, most = zip(*(inversion.iteration_quantiles(own) for own in
                             inversion.runs_of(one, "nonlinear", 1.0, (0,)).values()),
                           strict=True)
    assert records["nsf.sec5_3.gn_lo.modes"].value == min(medians)
    assert records["nsf.sec5_3.gn_hi.modes"].value == max(medians)
    assert f"the most in any step {max(most):g}" in records["nsf.sec5_3.gn_lo.modes"].note


def test_printed_numbers_are_of_gauss_newton_with_the_scenes_own_steps():
    run, rows = Records(), [("a", 0.0, 0, "linear", 1.0, *4 * [0.0], 1.0, 1.0, 1.0),
                         ("a", 0.0, 0, "nonlinear", 1.5, *4 * [0.0], 9.0, 9.0, 9.0),
                         ("a", 0.0, 0, "nonlinear", 1.0, *4 * [0.0], 2.0, 3.0, 7.0),
                         ("b", 0.0, 0, "nonlinear", 1.0, *4 * [0.0], 3.0, 5.0, 6.0)]
    inversion.record_iterations(run, rows, "")
    assert [value for value, _ in run.values()] == [3.0, 5.0]
    assert list(run) == ["nsf.sec5_3.gn_lo.modes", "nsf.sec5_3.gn_hi.modes"]
