"""`mpm-ref run --energy-budget`, and what `mpm-ref info` prints of it."""

import pytest
from command_line import mpm_ref

from mpm_ref.energy_budget import Terms
from mpm_ref.store.results import Results


@pytest.fixture
def counted(scene, tmp_path):
    """Results of a run with a budget."""
    out = tmp_path / "run.h5"
    assert mpm_ref("run", scene, "--out", out, "--energy-budget").exit_code == 0
    return out


def test_info_prints_the_budget_of_a_run(counted):
    text = mpm_ref("info", counted).stdout
    assert "J, changed by: transfer " in text
    with Results(counted) as results:
        budget = results.manifest["parts"][0]["energy_budget"]
        change = results.energy[-1].sum() - results.energy[0].sum()
    assert sum(budget[name] for name in Terms._fields) == pytest.approx(change, rel=1e-9)
    assert budget["last"] == pytest.approx(results.energy[-1].sum(), rel=1e-12)


def test_a_run_without_the_option_has_no_budget(scene, tmp_path):
    out = tmp_path / "run.h5"
    mpm_ref("run", scene, "--out", out)
    with Results(out) as results:
        assert results.manifest["parts"][0]["energy_budget"] == {}
    assert "changed by" not in mpm_ref("info", out).stdout


def test_each_part_of_a_resumed_run_has_its_own(scene, tmp_path):
    out = tmp_path / "run.h5"
    mpm_ref("run", scene, "--out", out, "--steps", 20, "--energy-budget")
    mpm_ref("run", scene, "--out", out, "--resume", "--energy-budget")
    with Results(out) as results:
        first, second = (part["energy_budget"] for part in results.manifest["parts"])
    assert second["first"] == pytest.approx(first["last"], rel=1e-12)
    assert mpm_ref("info", out).stdout.count("changed by") == 2


def test_an_implicit_run_is_refused_in_one_sentence(scene, tmp_path):
    scene.write_text('integrator = "hot"\n' + scene.read_text())
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--energy-budget")
    assert done.exit_code == 2
    assert "energy budget with the integrator" in done.stderr
    assert not (tmp_path / "run.h5").exists()
