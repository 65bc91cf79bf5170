"""Weights of the experiments that are told afterwards which strains their training met."""

import numpy as np
import pytest
import typer

from mpm_ref.materials.learned import weights
from mpm_ref.materials.learned.weights import load
from validation import bounds
from validation.nclaw import nets

ADDED = "seen", "dt", "seen_by"
GIVEN = {"low": [0.5] * 4, "high": [1.5] * 4}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with weights that know of no bounds, in which the command works."""
    laws = load(nets.FOLDER / "jelly.npz")
    monkeypatch.setattr(bounds, "FOLDER", tmp_path)
    about = {key: value for key, value in laws.about.items() if key not in ADDED}
    weights.save(tmp_path / "jelly.npz", laws._replace(about=about))
    monkeypatch.setattr(nets, "FOLDER", tmp_path)
    monkeypatch.setattr(bounds, "trained", nets.trained.__wrapped__)
    return tmp_path


def test_what_was_learned_stays_to_the_bit(folder, monkeypatch):
    monkeypatch.setattr(bounds, "bounds", lambda net, laws: GIVEN)
    before = load(folder / "jelly.npz")
    bounds.main(["jelly"])
    after = load(folder / "jelly.npz")
    assert after.about["seen"] == GIVEN
    assert after.about["dt"] == 5e-4
    assert after.about["seen_by"].startswith("python -m validation.bounds jelly, ")
    assert {**after.about, **before.about} == after.about
    for part in weights.PARTS:
        (was, kind), (now, same) = getattr(before, part), getattr(after, part)
        assert kind == same
        for a, b in zip(was, now, strict=True):
            np.testing.assert_array_equal(a[0], b[0])
            np.testing.assert_array_equal(a[1], b[1])


def test_bounds_that_are_known_stay(folder, monkeypatch):
    monkeypatch.setattr(bounds, "bounds", lambda net, laws: GIVEN)
    bounds.main(["jelly"])
    before = (folder / "jelly.npz").read_bytes()
    with pytest.raises(typer.BadParameter, match="jelly knows its bounds already"):
        bounds.main(["jelly"])
    assert (folder / "jelly.npz").read_bytes() == before


def test_missing_weights_are_told_before_any_are_written(folder, monkeypatch):
    monkeypatch.setattr(bounds, "bounds", lambda net, laws: GIVEN)
    before = (folder / "jelly.npz").read_bytes()
    with pytest.raises(typer.BadParameter, match=r"sand\.npz"):
        bounds.main(["jelly", "sand"])
    assert (folder / "jelly.npz").read_bytes() == before


@pytest.mark.parametrize("name", ["jelly-gnn", "jell"])
def test_only_laws_have_bounds(folder, name):
    with pytest.raises(typer.BadParameter, match=f"'{name}': expected one of jelly$"):
        bounds.main([name])
