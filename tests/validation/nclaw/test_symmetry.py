"""How symmetric the stress of laws is: against plain NumPy, and what is recorded."""

from types import SimpleNamespace

import neural_toys
import numpy as np
import pytest
from neural_toys import deformations, plain, trained
from record_verdicts import verdict

from mpm_ref.materials import FixedCorotated, Fluid
from mpm_ref.materials.learned import network, response
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nclaw import symmetry
from validation.nclaw.environments import ENVIRONMENTS


def test_the_skew_part_is_that_of_the_paper_s_stress():
    of, F = trained(response.Stress(neural_toys.UNIT), 3), deformations(3)
    skew, size = symmetry.split(network.build_law(of), F)
    tau = np.array([plain(of, one) for one in F])
    assert size == pytest.approx(np.linalg.norm(tau, axis=(1, 2)), rel=1e-9)
    expected = np.sqrt(sum((tau[:, a, b] - tau[:, b, a]) ** 2 for a, b in ((0, 1), (0, 2), (1, 2)))
                       / 2.0)
    assert skew == pytest.approx(expected, rel=1e-9, abs=1e-9 * size.max())
    assert skew.max() > 1e-3 * size.max()


@pytest.mark.parametrize("law", [
    network.build_law(trained(response.SymmetricStress(neural_toys.UNIT), 3)),
    FixedCorotated(4e4, 3e4), Fluid(5e4)], ids=["learned", "jelly", "water"])
def test_other_stresses_are_symmetric(law):
    skew, size = symmetry.split(law, deformations(3))
    assert (skew <= 1e-13 * size.max()).all()
    assert size.max() > 0.0


@pytest.mark.parametrize("name", ["jelly", "water"])
def test_gradients_are_those_of_the_training_run(name, monkeypatch):
    """All points of each frame; at the start, at rest."""
    short = symmetry.environment(name, steps=20, every=10)
    monkeypatch.setattr(symmetry, "environment", lambda name, every: short)
    F = symmetry.visited_gradients(name, 10).reshape(3, 1000, 3, 3)
    assert np.array_equal(F[0], np.tile(np.eye(3), (1000, 1, 1)))
    assert abs(F[2] - F[1]).max() > 0.0
    assert np.isfinite(F).all()


def test_what_must_be_symmetric_is_judged(tmp_path, monkeypatch):
    """Of two states the larger stress counts for more."""
    law = SimpleNamespace(law="law")
    monkeypatch.setattr(symmetry, "tested_laws", lambda run: {
        (method, name): law for method in ("ours", "admissible") for name in ENVIRONMENTS[:1]})
    monkeypatch.setattr(symmetry, "visited_gradients", lambda name, every: None)
    monkeypatch.setattr(symmetry, "split", lambda law, F: np.array([[3.0, 0.0], [5.0, 12.0]]))
    assert run_all([symmetry.symmetry.experiment], RunSetting("standard", tmp_path)) == []
    found = {r.target: r for r in ProfileResults(tmp_path).records("nclaw.symmetry")}
    ours, admissible = (found[f"nclaw.symmetry.{word}.jelly"] for word in ("ours", "admissible"))
    assert ours.value == pytest.approx(3.0 / 13.0)
    assert "0.3 in the median, 0.6 at most" in ours.note
    assert ours.scale == "2 states of the training run"
    assert (verdict(ours), verdict(admissible)) == ("info", "miss")
