"""NCLaw's Table 5: what is drawn, and answers of known laws."""

import numpy as np
import pytest

from mpm_ref.materials import Fluid, Hencky, NoFlow, VonMises
from mpm_ref.materials.learned.weights import LearnedLaws
from mpm_ref.trajectories import Observed
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.weights_needed import Untrained
from validation.nclaw import identified


@pytest.fixture(scope="module")
def F():
    """Gradients of moderate strain."""
    return np.eye(3) + 0.1 * np.random.default_rng(0).standard_normal((20, 3, 3))


def test_trial_gradients_follow_those_drawn():
    """F_trial = (I + dt C) F, with C of the step after."""
    rng, dt = np.random.default_rng(1), 1e-2
    shape = 4, 5, 3, 3
    run = Observed(None, None, rng.standard_normal(shape), rng.standard_normal(shape))
    F, trial = identified.drawn(run, dt)
    assert F.shape == trial.shape == (identified.POINTS, 3, 3)
    known = {run.F[k, p].tobytes(): (np.eye(3) + dt * run.C[k + 1, p]) @ run.F[k, p]
             for k in range(3) for p in range(5)}
    assert all(np.allclose(b, known[a.tobytes()], rtol=1e-14) for a, b in zip(F, trial))


def test_gradients_of_a_frame_are_those_of_all_points():
    rng, dt = np.random.default_rng(1), 1e-2
    run = Observed(None, None, rng.standard_normal((4, 5, 3, 3)), rng.standard_normal((4, 5, 3, 3)))
    F, trial = identified.at_step(run, dt, 2)
    assert (F == run.F[2]).all()
    assert np.allclose(trial, F + dt * np.matmul(run.C[3], F), rtol=1e-14)


def test_errors_are_of_the_whole_run_of_frames_and_of_doing_nothing(tmp_path, monkeypatch):
    """Of laws that answer 0 and the trial gradient, both are the same."""
    monkeypatch.setattr(identified, "trained", lambda name: LearnedLaws(
        Fluid(0.0), NoFlow(), {}) if name == "water" else missing(name))
    for maker in ("learned_law", "learned_flow"):
        monkeypatch.setattr(identified, maker, lambda law: law)
    monkeypatch.setattr(identified, "trajectory", lambda name: short_run())
    monkeypatch.setattr(identified, "STEPS", (1, identified.FRAME))
    setting = RunSetting("quick", tmp_path, targets=targets.load())
    assert run_all([identified.table5.experiment], setting) == []
    results = ProfileResults(tmp_path)
    found = {r.target.removeprefix("nclaw.table5."): r.value
             for r in results.records("nclaw.table5")}
    for start in ("", "frame."):
        assert found[f"{start}P.ours"] == found[f"{start}P.no_stress"] > 0.0
        assert found[f"{start}Fnew.ours"] == pytest.approx(found[f"{start}Fnew.unchanged"])
    assert found["P.ours"] != found["frame.P.ours"]
    frames = results.table("nclaw.table5", "frames")
    assert frames["step"].tolist() == [1, identified.FRAME]
    assert frames["P"][1] == pytest.approx(found["frame.P.ours"])


def short_run():
    """An `Observed` run of 20 steps of 30 points."""
    rng = np.random.default_rng(2)
    F = np.eye(3) + 0.1 * rng.standard_normal((21, 30, 3, 3))
    return Observed(None, None, rng.standard_normal(F.shape), F)


def missing(name):
    raise Untrained(f"no weights {name}")


def test_stress_is_the_first_piola(F):
    """P = lam (J - 1) cof(F) of a fluid (NCLAW-eq20)."""
    J = np.linalg.det(F)[:, None, None]
    P, _ = identified.answers(Fluid(3.0), NoFlow(), F, F)
    assert np.allclose(P, 3.0 * (J - 1.0) * J * np.linalg.inv(F).mT, rtol=1e-12, atol=1e-13)


def test_flows_answer_trial_gradients(F):
    """Those within the yield surface as they are; no volume change beyond it (NCLAW-eq19)."""
    law = Hencky(1.0, 2.0)
    for tau_y, flows in ((1e3, False), (1e-2, True)):
        new = identified.answers(law, VonMises(tau_y, 1e-3), F, F)[1]
        assert np.allclose(np.linalg.det(new), np.linalg.det(F), rtol=1e-12)
        assert np.allclose(new, F, atol=1e-12) != flows


def test_without_shear_volume_is_left(F):
    assert np.allclose(np.linalg.det(identified.without_shear(F)), np.linalg.det(F), rtol=1e-12)
