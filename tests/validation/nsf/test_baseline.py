"""LDM on trained networks, the model that NSF is compared with."""

from itertools import islice

import numpy as np
import pytest

from mpm_ref.rom.fields.elastic import ElasticMap, elastic_stress
from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.study.run import RunOptions, ldm_run
from validation.nsf import baseline
from validation.nsf.errors import COLUMNS
from validation.nsf.networks import nets, trained
from validation.nsf.reduced_runs import fit_study
from validation.nsf.studies import ball, bread, jelly, metal

OPTIONS = RunOptions(points=40)
VALUE = 0.4


def test_numbers_are_places_of_the_network():
    _, g = baseline.map_of(jelly(4).run(VALUE), trained("jelly-waves").field.g)
    xhat, some = trained("jelly-waves").xhat[0, 40], np.array([3, 50, 150])
    for ours, network in zip(g.derivatives(some, xhat), g.g.derivatives(g.X[some], xhat),
                             strict=True):
        np.testing.assert_array_equal(ours, network)
    np.testing.assert_array_equal(g.velocity(some, xhat, xhat), g.g.velocity(g.X[some], xhat, xhat))


def test_a_run_by_numbers_is_that_of_ldm_by_places():
    model = trained("ball-waves")
    full, g = baseline.map_of(ball(6).run(20.0), model.field.g)
    ours = baseline.ldm_plan(full, g, OPTIONS, (model.rest, 3))
    theirs = ldm_run(full._replace(by_number=False), g.g, OPTIONS, model.rest, 3)
    for one, other in zip(islice(ours.states(), 3), islice(theirs.states(), 3), strict=True):
        np.testing.assert_allclose(one.latent.xhat, other.latent.xhat, rtol=1e-9)
    assert np.any(one.latent.vhat)
    assert ours.stepper.transfer == "pic"


def test_the_stress_is_that_of_the_gradient_and_of_the_bodys_own_law():
    model = trained("bread-waves")
    full, g = baseline.map_of(bread(4).run(3.3), model.field.g)
    xhat, last = model.xhat[0, 20], len(full.bodies[0].id)
    points = np.array([last - 1, last])
    F = g.g.derivatives(g.X[points], xhat)[1]
    tau = ElasticMap(g, full.law).stress(points, xhat)
    for k, body in enumerate(full.bodies):
        np.testing.assert_allclose(tau[k], elastic_stress(F[k:k + 1], body.law)[0], rtol=1e-12)
    assert full.bodies[0].law != full.bodies[1].law


def test_a_scene_with_plasticity_has_no_such_model():
    with pytest.raises(ValueError, match="plastic flow"):
        baseline.map_of(metal(4).run(0.1), trained("jelly-waves").field.g)


def test_all_three_models_are_compared_on_the_same_tests():
    study = jelly(4)._replace(train=(0.3, 0.5), test=(VALUE,), samples=OPTIONS.points,
                              sizes=Sizes(r=3, modes=8, tau=12, C=12, smoothing=1e-4))
    recorded = {}

    class Run:
        def record(self, target, value, **rule):
            recorded[target] = value, rule

    rows = baseline.record_scene(Run(), "jelly", fit_study(study), trained("jelly-waves"))
    assert [row[:3] for row in rows] == [(f"jelly.{word}", VALUE, 40) for word in baseline.MODELS]
    ldm, nsf, modes = (row[5] for row in rows)
    assert recorded["nsf.jelly.baseline_error.positions"][0] == pytest.approx(100.0 * ldm)
    assert "comparator" not in recorded["nsf.jelly.baseline_error.positions"][1]
    assert recorded["nsf.baseline.jelly.modes"][0] == pytest.approx(100.0 * modes)
    assert recorded["nsf.baseline.jelly.share"][0] == pytest.approx(nsf / ldm)
    assert {*baseline.SCENES} <= {name.split("-")[0] for name in nets()}


def test_no_share_is_taken_of_an_error_of_a_run_that_broke_down():
    def row(error):
        return tuple(error if name == "origin" else 0.0 for name in COLUMNS)

    assert baseline.share_of([row(0.01)], [row(0.02)]) == pytest.approx(0.5)
    assert np.isnan(baseline.share_of([row(0.01)], [row(0.02), row(np.inf)]))
