"""What a body must carry to be stepped, and that nothing is shared behind its back."""

import numpy as np
import pytest

from mpm_ref.body import Body, check_fit, particles_at, permute, with_separate_gradient
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import NoFlow, make_flow, make_law

ELASTIC = make_law("hencky", E=1e4, nu=0.3)
X = np.random.default_rng(0).uniform(0.0, 0.4, (12, 2))


def body(transfer="mls", flow=None, **changed):
    particles = particles_at(X, 0.0 * X, np.ones(12), np.full(12, 1e-3), transfer)
    flow = NoFlow() if flow is None else flow
    return Body("b", particles._replace(**changed), ELASTIC, flow, np.arange(12))


def spoiled(field, p, value):
    made = body()
    getattr(made.particles, field)[p] = value
    return made


@pytest.mark.parametrize("transfer", ["pic", "flip", "apic", "mls"])
def test_a_body_made_for_the_transfer_fits(transfer):
    check_fit(body(transfer), Scheme(transfer=transfer), 2)


def test_relaxation_needs_a_gradient_of_its_own():
    relaxed = Scheme(relaxation=1e-3)
    with pytest.raises(ValueError, match=r"same array as C for 'mls' without.* relaxation 0\.001"):
        check_fit(body(), relaxed, 2)
    check_fit(body()._replace(particles=with_separate_gradient(body().particles)), relaxed, 2)


@pytest.mark.parametrize(("made", "transfer", "said"), [
    (body("apic"), "mls", "same array as C"),
    (body("mls"), "apic", "same array as C"),
    (body("pic"), "apic", "carries no C"),
    (body("mls"), "pic", "carries a C"),
    (body(flow=make_flow("von_mises_hardening", ELASTIC, 2, tau_y=1e2, xi=0.1)), "mls",
     "Hardening changes y"),
    (spoiled("v", 3, np.nan), "mls", r"v of particle 3 is \[nan nan\]"),
    (spoiled("m", 5, -1.0), "mls", "m of particle 5 is -1.0, expected a positive"),
    (spoiled("V0", 5, 0.0), "mls", "V0 of particle 5 is 0.0, expected a positive"),
    (body(F=np.ones(12), tau=np.zeros(12)), "mls", "F has shape"),
    (body(tau=np.zeros(12)), "mls", "tau has shape"),
    (body(x=np.zeros((12, 3))), "mls", r"x has shape \(12, 3\), expected \(12, 2\)"),
    (Body("b", particles_at(X[:0], X[:0], [], []), ELASTIC, NoFlow(), np.arange(0)), "mls",
     "no particles"),
])
def test_a_body_that_does_not_fit_is_refused(made, transfer, said):
    with pytest.raises(ValueError, match=said):
        check_fit(made, Scheme(transfer=transfer), 2)


def test_arrays_are_copied_so_that_a_sort_moves_each_once():
    ones = np.array([1.0, 2.0, 3.0])
    made = Body("b", particles_at(X[:3], X[:3], ones, ones), ELASTIC, NoFlow(), np.arange(3))
    permute(made, np.array([2, 0, 1]))
    assert made.particles.m.tolist() == [3.0, 1.0, 2.0]
    assert np.array_equal(made.particles.x, X[[2, 0, 1]])
    assert ones.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(("gravity", "dx", "said"), [
    ((0.0, 0.0, -9.8), 0.1, "expected 2 finite numbers"),
    ((0.0, np.nan), 0.1, "expected 2 finite numbers"),
    ((0.0, 0.0), 0.0, "dx = 0.0"),
])
def test_a_stepper_refuses_what_it_cannot_use(gravity, dx, said):
    with pytest.raises(ValueError, match=said):
        Stepper(Scheme(), dx, 2, gravity)


@pytest.mark.parametrize("dt", [0.0, -1e-3, np.nan, np.inf])
def test_a_step_takes_positive_time(dt):
    with pytest.raises(ValueError, match="expected a positive, finite time"):
        Stepper(Scheme(), 0.1, 2, (0.0, 0.0)).step((body(),), 0.0, dt)


@pytest.mark.parametrize("transfer", ["apic", "mls"])
def test_strain_does_not_depend_on_damping(transfer):
    """NSF-rpic damps the affine field that is handed on, not the strain of the step."""
    F = []
    for damping in (0.0, 0.5, 1.0):
        made = body(transfer)
        made.particles.v[:] = X
        made.particles.C[:] = np.eye(2)
        stepper = Stepper(Scheme(transfer=transfer, rpic=damping), 0.1, 2, (0.0, 0.0))
        stepper.start((made,))
        stepper.step((made,), 0.0, 1e-3)
        F.append(made.particles.F.copy())
    assert np.abs(F[0] - np.eye(2)).max() > 5e-4
    assert np.array_equal(F[0], F[1])
    assert np.array_equal(F[0], F[2])
