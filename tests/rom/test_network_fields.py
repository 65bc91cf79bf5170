"""NSF's three networks as the fields of a run, whose points are numbers."""

import field_toys
import numpy as np
import pytest
import rom_toys
from field_toys import MU, Q, latents, networks

from mpm_ref.rom.fields.network import learned_fields
from mpm_ref.rom.latent import Latent
from mpm_ref.rom.projection import project_position
from mpm_ref.rom.step import MaterialPoints, nsf_stepper
from tests.rom.test_nsf_step import after_grid
from validation.nsf.pointwise_networks import infer

POINTS = np.array([7, 3, 190, 3])
SIZE = 0.2


def fields(d, q=Q, n=200):
    return learned_fields(rom_toys.cloud(d, n), networks(d, q), MU[:q], SIZE)


def test_fields_are_those_of_the_networks_at_the_points_of_these_numbers(d):
    one, xhat = fields(d), latents()
    assert (one.dim, one.r) == (d, field_toys.R)
    x, G, tau, C = infer(one.g, one.h, one.l, one.X[POINTS], xhat, MU)
    at, none, slope = one.derivatives(POINTS, xhat)
    assert none is None
    for a, b in ((one.place(POINTS, xhat), x), (at, x), (slope, G),
                 (one.stress(POINTS, xhat), tau), (one.affine(POINTS, xhat), C)):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-13 * abs(b).max())
    np.testing.assert_array_equal(tau, tau.transpose(0, 2, 1))


def test_values_of_a_stress_are_the_upper_triangle_row_by_row():
    """tau_11, tau_12, tau_13, tau_22, tau_23, tau_33; C row by row."""
    one, xhat = fields(3), latents()
    six = one.h.values(one.X[POINTS], xhat, MU)
    tau = one.stress(POINTS, xhat)
    for k, (i, j) in enumerate([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]):
        np.testing.assert_array_equal(tau[:, i, j], six[:, k])
        np.testing.assert_array_equal(tau[:, j, i], six[:, k])
    nine = one.l.values(one.X[POINTS], xhat)
    np.testing.assert_array_equal(one.affine(POINTS, xhat)[:, 1, 2], nine[:, 5])


def test_a_run_with_other_parameters_has_another_stress_alone(d):
    one, xhat = fields(d), latents()
    other = one.with_parameters(MU + 1.0)
    assert abs(other.stress(POINTS, xhat) - one.stress(POINTS, xhat)).max() > 1e-3
    np.testing.assert_array_equal(other.place(POINTS, xhat), one.place(POINTS, xhat))
    np.testing.assert_array_equal(other.affine(POINTS, xhat), one.affine(POINTS, xhat))


def test_fields_that_depend_on_no_parameter_may_be_told_some(d):
    one = learned_fields(rom_toys.cloud(d, 200), networks(d), MU, SIZE)
    plain, xhat = fields(d, q=0), latents()
    np.testing.assert_array_equal(one.stress(POINTS, xhat), plain.stress(POINTS, xhat))


def test_no_point_that_is_near_is_missed(d):
    """And most of those that are far are left out."""
    one, xhat = fields(d, n=3000), latents()
    sample, distance = one.place(POINTS[:2], xhat), 0.05
    x = one.place(np.arange(3000), xhat)
    gap = np.abs(x[:, None] - sample).max(axis=2).min(axis=1)
    found = one.near(xhat, sample, distance)
    assert set(np.flatnonzero(gap <= distance)) <= set(found.tolist())
    assert 0 < len(found) < 3000
    assert len(found) == len(set(found.tolist()))


def test_latent_coordinates_are_found_from_positions_of_numbered_points(d):
    one, xhat = fields(d), latents()
    some = np.arange(0, 200, 5)
    fit = project_position(one, some, one.place(some, xhat), xhat + 0.05)
    assert fit.y == pytest.approx(xhat, abs=1e-8)


@pytest.mark.parametrize(("change", "said"), [
    (lambda g, h, l: (g, l, l), "the stress has 3 axes, 3 latent coordinates and 9 values: "
                                "expected 3, 3 and 6"),
    (lambda g, h, l: (g, h, h._replace(units=l.units)), "the affine field has 3 axes, 5 latent"),
    (lambda g, h, l: (rom_toys.decoder(3, 2), h, l), "the stress has 3 axes, 3 .*expected 3, 2"),
    (lambda g, h, l: (rom_toys.decoder(2, 3), h, l), "the stress has 3 axes, .*expected 2, 3"),
    (lambda g, h, l: (g, h, field_toys.field(3, 9, 1)), "depends on 2 parameters, the affine "
                                                        "field on 1"),
], ids=["outputs", "latents of l", "latents of g", "axes", "parameters"])
def test_networks_that_do_not_fit_are_refused(change, said):
    with pytest.raises(ValueError, match=said) as refusal:
        learned_fields(rom_toys.cloud(3, 20), change(*networks(3, Q)), MU, SIZE)
    assert "\n" not in str(refusal.value)


def test_points_and_parameters_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"points of shape \(20, 2\) for networks of 3 axes"):
        learned_fields(rom_toys.cloud(2, 20), networks(3, Q), MU, SIZE)
    with pytest.raises(ValueError, match=r"mu of shape \(1,\): expected \(2,\)"):
        learned_fields(rom_toys.cloud(3, 20), networks(3, Q), MU[:1], SIZE)
    with pytest.raises(ValueError, match=r"mu of shape \(\): expected \(2,\)"):
        fields(3).with_parameters(31.0)


def test_a_step_on_networks_moves_samples_as_when_all_points_are_stepped(d):
    n, dt = 600, 1e-3
    one, xhat = fields(d, n=n), latents()
    matter = MaterialPoints(np.full(n, 2.0), np.full(n, 1e-3), np.zeros((n, d)))
    span = np.ptp(one.place(np.arange(n), xhat), axis=0).max()
    stepper = nsf_stepper(one, matter, span / 16, 2, np.zeros(d))
    at, samples = Latent(xhat, before=xhat - 0.01), np.array([5, 71, 300])
    points, x = stepper.quadrature.integration_points(one, xhat, samples)
    np.testing.assert_allclose(x, one.place(points, xhat), rtol=0.0, atol=1e-14 * span)
    assert len(points) < n
    whole = np.concatenate([samples, np.setdiff1d(np.arange(n), samples)])
    few, everything = (after_grid(stepper, at, N, one.place(N, xhat), 3, dt)
                       for N in (points, whole))
    assert np.abs(everything - one.place(samples, xhat)).max() > 1e-4 * span
    np.testing.assert_allclose(few, everything, rtol=0.0, atol=1e-12 * np.abs(everything).max())
    after, report = stepper.step(at, samples, 0.0, dt)
    assert np.array_equal(after.before, xhat)
    assert (report.samples, report.points, report.rank) == (3, len(points), field_toys.R)
