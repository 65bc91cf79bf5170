"""The parts of the error of the stress."""

import numpy as np
import pytest

from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.symmetric import values
from validation.nsf import stress
from validation.nsf.networks import trained
from validation.nsf.reduced_runs import fit_study
from validation.nsf.studies import jelly

VALUE = 0.45


@pytest.fixture(scope="module")
def one():
    """A small study of the scene of trained networks."""
    return fit_study(jelly(4)._replace(train=(0.3, 0.5), test=(VALUE,), samples=40, sizes=Sizes(
        r=3, modes=8, tau=12, C=12, smoothing=1e-4)))


def share(tau, reference):
    """Return the error of stresses over their norm, at all times but the first."""
    return np.linalg.norm(tau[1:] - reference[1:]) / np.linalg.norm(reference[1:])


def test_training_runs_are_taken_as_they_are_and_between(one):
    tau, reference = one.runs.tau.astype(float), one.tests[VALUE].tau[0].astype(float)
    found = stress.lookup_errors(one.runs, VALUE, reference)
    assert found["nearest"] == pytest.approx(share(tau[1], reference))
    between = 0.25 * tau[0] + 0.75 * tau[1]
    assert found["interpolated"] == pytest.approx(share(between, reference), rel=1e-5)
    even = stress.lookup_errors(one.runs, 0.4, reference)["nearest"]
    assert even == pytest.approx(min(share(run, reference) for run in tau))


def test_no_coefficients_of_the_modes_come_nearer_than_the_projection(one):
    modes = one.fields.tau.modes.reshape(-1, 12)
    reference = one.tests[VALUE].tau[0].astype(float).reshape(-1, len(modes))
    fit = np.linalg.lstsq(modes, reference.T, rcond=None)[0]
    assert stress.projection_error(one, VALUE) == pytest.approx(share((modes @ fit).T, reference))


def test_coordinates_are_those_nearest_to_the_positions(one):
    run = one.runs._replace(**{name: getattr(one.runs, name)[:1]
                               for name in ("mu", "x", "tau", "C")})
    points, fields = np.arange(len(run.X)), one.fields_of_run(0.3)
    tau = np.array([values(fields.stress(points, xhat)) for xhat in one.xhat[0]])
    own = share(tau, run.tau[0].astype(float))
    assert stress.nearest_error(one._replace(tests={0.3: run}), 0.3) == pytest.approx(own, rel=0.1)


def test_steps_half_as_long_end_at_the_same_times(one, monkeypatch):
    simulated, scene = [], one.study.run(VALUE)

    def simulate(scene, mu, kind, every):
        simulated.append((scene.dt, scene.steps, every))
        return one.tests[VALUE]

    monkeypatch.setattr(stress, "simulate_history", simulate)
    assert stress.refined_error(one, VALUE) == 0.0
    assert simulated == [(0.5 * scene.dt, 2 * scene.steps, 2 * one.study.spacing)]


def test_runs_are_judged_beside_training_runs(one):
    recorded = {}

    class Run:
        def record(self, target, value, **rule):
            recorded[target] = value, rule.get("bound")

    parts = {("training", "nearest"): (0.4, 0.2), ("training", "interpolated"): (0.1, 0.1),
             ("networks", "coordinates"): (0.2, 0.2), ("networks", "samples"): (0.6, 0.3),
             ("modes", "coordinates"): (0.1, 0.1), ("modes", "samples"): (0.2, 0.1)}
    rows = [("jelly", test, *part, own) for part, both in parts.items()
            for test, own in enumerate(both)]
    studies = {"modes": one, "networks": stress.on_networks(Run(), "jelly", one)}
    stress.record_parts(Run(), "nsf.stress.jelly", rows, studies)
    assert recorded["nsf.stress.jelly.networks.snapshots"][0] == pytest.approx(
        100.0 * trained("jelly-waves").about["errors"]["stress"])
    assert recorded["nsf.stress.jelly.networks.over.nearest"] == (pytest.approx(1.5), 1.0)
    assert recorded["nsf.stress.jelly.modes.over.interpolated"] == (pytest.approx(1.5), 1.0)
    assert recorded["nsf.stress.jelly.networks.over.coordinates"] == (pytest.approx(2.25), 2.0)
    assert recorded["nsf.stress.jelly.training.nearest"][0] == pytest.approx(30.0)


def test_colours_are_over_their_range(one, monkeypatch):
    true = np.tile(np.linspace(0.0, 4.0, 100), (3, 1))
    off = np.where(np.arange(100) < 10, 1.0, 0.2)
    monkeypatch.setattr(stress, "history_points", lambda *args: {"test_tau": true})
    monkeypatch.setattr(stress, "run_points", lambda *args: {"run_tau": true - off})
    assert stress.colour_error(one, VALUE) == pytest.approx(0.25)
    monkeypatch.setattr(stress, "run_points", lambda *args: {"run_tau": true * np.nan})
    assert np.isnan(stress.colour_error(one, VALUE))
