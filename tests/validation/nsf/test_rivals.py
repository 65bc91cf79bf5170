"""Rivals of NSF's reduced runs: which runs are compared, on which fields, and what they hold."""

import numpy as np
import pytest

from mpm_ref.rom.fields.pod_fields import Sizes
from validation.nsf import networks_runs, rivals
from validation.nsf.networks import fields_of, nets, trained
from validation.nsf.reduced_runs import fit_study
from validation.nsf.studies import jelly

VALUE = 0.4


@pytest.fixture(scope="module")
def one():
    """A small study of the scene of trained networks."""
    return fit_study(jelly(4)._replace(train=(0.3, 0.5), test=(VALUE,), samples=40, sizes=Sizes(
        r=3, modes=8, tau=12, C=12, smoothing=1e-4)))


def test_reduced_runs_are_on_networks_and_on_modes(one):
    model = trained("jelly-waves")
    found = rivals.rivals_of(one, model, VALUE, 1.0)
    assert [source.name for source in found.sources[:3]] == [*rivals.REDUCED]
    assert [source.name for source in found.sources[3:5]] == ["full", "mls.x1"]
    networks, drawn, _ = found.sources[:3]
    n = len(one.fields.X)
    weights = sum(networks_runs.weight_count(
        nets()["jelly-waves"].study, name, 64, 3 if name in "hl" else 0) for name in "ghl")
    assert 8 * (weights + 3 * n) < networks.size < 8 * 1.1 * (weights + 3 * n)
    _, start = next(networks.states())
    np.testing.assert_array_equal(networks.place(start), fields_of(model, one.study).place(
        np.arange(n), start.xhat))
    _, start = next(drawn.states())
    np.testing.assert_array_equal(drawn.place(start), one.fields.place(np.arange(n), start.xhat))


def test_standard_runs_are_those_of_the_trained_networks():
    class Standard:
        profile = "standard"

    for name in rivals.STUDIES:
        assert rivals.study_of(Standard, name) == nets()[f"{name}-waves"].study
