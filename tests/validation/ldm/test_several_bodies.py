"""Reduced runs of two elastic bodies: the scene, its rivals, and what is recorded."""

import numpy as np
import pytest
from record_verdicts import verdict

from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.scene import build
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.ldm import several_bodies
from validation.ldm.several_bodies import full_run, rivals_of, training, two_blocks


@pytest.fixture
def short(monkeypatch):
    """Runs of few steps, of few modes."""
    monkeypatch.setattr(several_bodies, "STEPS", 12)
    monkeypatch.setattr(several_bodies, "SIZES", (2, 6))


@pytest.mark.parametrize(("start", "velocity", "gap"), [("along", (0.7, 0.0), 0.0),
                                                        ("falling", (0.0, -0.7), 0.2)])
def test_the_upper_block_is_stiff_and_heavy_and_starts_with_a_speed(start, velocity, gap):
    soft, hard = build(two_blocks(start, "apic", 0.7)).bodies
    assert len(soft.id) == len(hard.id) == 96
    np.testing.assert_array_equal(hard.particles.v, np.tile(velocity, (96, 1)))
    assert not soft.particles.v.any()
    assert hard.particles.m.sum() / soft.particles.m.sum() == pytest.approx(3.0)
    lowest, highest = hard.particles.x[:, 1].min(), soft.particles.x[:, 1].max()
    assert lowest - highest == pytest.approx(gap + 0.05)


def test_a_full_run_has_both_bodies_at_all_steps(short):
    scene = two_blocks("along", "pic", 1.0)
    found = full_run(scene)
    assert found.x.shape == (13, 192, 2)
    assert found.F.shape == (13, 192, 2, 2)
    np.testing.assert_array_equal(found.x[0], ldm_full_model(scene).X)
    assert (found.x[-1, 96:, 0] - found.x[0, 96:, 0]).min() > 0.5 * 12 * 0.002


def test_training_runs_are_looked_up(short):
    trained = training("along", "pic")
    near = rivals_of(trained, 1.3).trained
    low, high = (one.x for one in trained.runs[1:3])
    np.testing.assert_array_equal(near["nearest"], high)
    np.testing.assert_allclose(near["interpolated"], 0.4 * low + 0.6 * high, atol=1e-15)


def test_errors_and_ratios_are_recorded(short, tmp_path):
    setting = RunSetting("quick", tmp_path, targets=targets.load())
    assert run_all([several_bodies.several_bodies.experiment], setting) == []
    results = ProfileResults(tmp_path)
    found = {r.target.removeprefix("ldm.several-bodies."): r
             for r in results.records("ldm.several-bodies")}
    table = results.table("ldm.several-bodies", "runs")
    errors = {(table["start"][k], table["rival"][k]): table["displacement"][k]
              for k in range(len(table["start"]))}
    for start in ("along", "falling"):
        for r in (2, 6):
            own = errors[start, f"modes.{r}"]
            assert found[f"{start}.pic.modes.{r}"].value == pytest.approx(100.0 * own)
            assert found[f"{start}.pic.modes.{r}.states"].value <= 100.0 * own * (1.0 + 1e-9)
            for name in ("nearest", "interpolated"):
                ratio = found[f"{start}.pic.modes.{r}.over.{name}"]
                assert ratio.value == pytest.approx(own / errors[start, name])
                assert verdict(ratio) == ("pass" if ratio.value <= 1.0 else "miss")
            assert verdict(found[f"{start}.pic.modes.{r}.over.nearest"]) == "pass"
