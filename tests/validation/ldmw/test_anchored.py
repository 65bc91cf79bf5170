"""A learned map that is made the identity at rest."""

import numpy as np
from rom_toys import cloud, decoder

from mpm_ref.rom.fields.elastic import ElasticMap
from mpm_ref.rom.kinematics import evaluate
from mpm_ref.rom.projection import project_position
from validation.ldm.networks import trained
from validation.ldm.workshop_studies import SHEAR3
from validation.ldmw.anchored import Anchored
from validation.ldmw.runs import by_points, study_runs


def test_it_is_the_identity_at_rest_and_moves_as_before(d):
    map, rest, X = decoder(d, 3), np.full(3, 0.3), cloud(d, 30)
    found = Anchored(map, rest)
    at = evaluate(found, X, rest)
    np.testing.assert_allclose(at.x, X, atol=1e-14)
    np.testing.assert_allclose(at.F, np.broadcast_to(np.eye(d), at.F.shape), atol=1e-14)
    xhat, vhat = np.array([-0.2, 0.5, 0.1]), np.array([1.0, -2.0, 0.5])
    moved, own = evaluate(found, X, xhat), evaluate(map, X, xhat)
    np.testing.assert_array_equal(moved.G, own.G)
    np.testing.assert_allclose(moved.x - at.x, own.x - evaluate(map, X, rest).x, atol=1e-14)
    np.testing.assert_array_equal(found.place(X, xhat), moved.x)
    np.testing.assert_allclose(found.velocity(X, xhat, vhat), moved.G @ vhat, atol=1e-14)
    assert (found.dim, found.r) == (d, 3)
    back = project_position(found, X, moved.x, rest)
    np.testing.assert_allclose(back.y, xhat, atol=1e-6)


def test_f_is_the_gradient_of_its_positions(d):
    found, X, xhat = Anchored(decoder(d, 3), np.full(3, 0.3)), cloud(d, 5), np.full(3, -0.4)
    F, h = found.derivatives(X, xhat)[1], 1e-6
    for a in range(d):
        step = h * np.eye(d)[a]
        slope = (found.place(X + step, xhat) - found.place(X - step, xhat)) / (2.0 * h)
        np.testing.assert_allclose(F[:, :, a], slope, atol=1e-8)


def test_the_stress_at_rest_is_what_accelerates_a_map_without_f_in_its_loss():
    tests = study_runs(SHEAR3, SHEAR3.test[:1])
    model, every = trained("shear3-no-F"), by_points(np.arange(3))
    anchored = Anchored(model.field, model.rest)
    plain, exact = (tests.errors(g, model.rest, every) for g in (model.field, anchored))
    assert plain.velocity > 100.0 * exact.velocity
    law = tests.cases[0].law
    stress = [abs(ElasticMap(g, law).stress(tests.X, model.rest,
                                            g.derivatives(tests.X, model.rest)[1])).max()
              for g in (model.field, anchored)]
    assert stress[1] < 1e-9 * stress[0]
