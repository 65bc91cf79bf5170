"""Laws whose training counts what a second return changes: what is recorded of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.materials import FixedCorotated, Fluid, FluidProjection, NoFlow
from validation.nclaw import idempotence
from validation.nclaw.dissipation import TRUE, MaterialLaws
from validation.nclaw.errors import ErrorRow
from validation.nclaw.idempotence import (
    NAMES,
    TERM,
    VARIANTS,
    Returns,
    idempotent_nets,
    material_laws,
    passed_on,
    record_errors,
    record_returns,
    returns_of,
    shears,
)
from validation.nclaw.trained_laws import identity, nets


def test_trainings_differ_by_the_term_alone():
    found = idempotent_nets()
    assert len(found) == len(NAMES) * len(VARIANTS)
    for name in NAMES:
        again = found[f"{name}-again"]
        assert again.start == name
        assert "idempotence" not in identity(again)     # nor is it in that of older weights
        for word, without in (("idempotent", again), ("idempotent-start", nets()[name])):
            variant = found[f"{name}-{word}"]
            assert variant == without._replace(idempotence=TERM)
            assert identity(variant) == identity(without) | {"idempotence": TERM}
    assert not set(found) & set(nets())


def test_a_training_that_diverged_is_recorded_with_its_epochs(monkeypatch):
    rows, asked = {}, []
    run = SimpleNamespace(record=lambda id, value, **notes: rows.update(
        {id: (value, notes["scale"])}))
    monkeypatch.setattr(idempotence, "load_available",
                        lambda run, names, load: asked.extend(names) or {})
    idempotence.available_laws(run)
    assert rows == {"nclaw.idempotence.water-idempotent-start.epochs": (184, "of 300 epochs")}
    assert asked == ["water", "water-again", "water-idempotent"]


@pytest.mark.parametrize(("pair", "share"), [
    (MaterialLaws(FixedCorotated(1.0, 1.0), NoFlow()), 1.0),
    (MaterialLaws(Fluid(1.0), FluidProjection()), 0.0)])
def test_share_of_a_shear_that_a_return_passes_on(pair, share, rng):
    """Nothing of a fluid's but the change of volume, which is of second order; all without one."""
    F = np.eye(3) + 0.1 * rng.normal(size=(9, 3, 3))
    A = shears(9, rng)
    assert np.trace(A, axis1=1, axis2=2) == pytest.approx(np.zeros(9), abs=1e-15)
    assert np.linalg.norm(A, axis=(1, 2)) == pytest.approx(np.ones(9))
    assert passed_on(pair, F, A) == pytest.approx(np.full(9, share), abs=1e-3)


def test_returns_of_true_water(rng):
    """A projection: a second return changes nothing."""
    found = Returns(*returns_of("water", material_laws({})[TRUE, "water"], 100, rng))
    assert (found.frames, found.why) == (2, "")
    assert max(found.shares) < 1e-3
    assert found.second < 1e-12


def test_what_is_recorded():
    found = {}
    run = SimpleNamespace(profile="standard", record=lambda name, value, **rest: found.update(
        {name: (value, rest["comparator"], rest["note"])}))
    record_errors(run, ("water", "velocity"),
                  [ErrorRow(method, "water", "velocity", draw, error, -1, "")
                   for method, own in {"ours": (1.0, 3.0), "idempotent": (2.0, 5.0)}.items()
                   for draw, error in enumerate(own)])
    record_returns(run, ("ours", "water"), Returns([0.25, 0.5, 0.75], 0.125, 20, ""))
    id, said = "nclaw.idempotence", "one training; printed 1.9e-05 m^2"
    assert {name: row[:2] for name, row in found.items()} == {
        f"{id}.ours.water.velocity": (2.0, "info"),
        f"{id}.idempotent.water.velocity": (3.5, "info"),
        f"{id}.ours.water.passed": (0.5, "info"), f"{id}.ours.water.second": (0.125, "info")}
    assert found[f"{id}.ours.water.velocity"][2] == said
    assert "0.25 and 0.75" in found[f"{id}.ours.water.passed"][2]
