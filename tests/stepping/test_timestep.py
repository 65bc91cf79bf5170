"""The stable time step: closed forms for one particle, and that it suffices for a cloud."""

from math import sqrt
from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.body import Body, particles_at, with_separate_gradient
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, HerschelBulkley, NeoHookean, NoFlow
from mpm_ref.problem import Clock
from mpm_ref.simulate import MOST_STEPS, next_dt
from mpm_ref.timestep import TooLarge, largest_modulus, moduli, refuse, stable_dt

DX, RHO, LAW = 0.1, 1000.0, FixedCorotated(4e4, 6e4)
ELASTIC = LAW, NoFlow()
K = 2.0 * LAW.mu + 2.0 * LAW.lam                # at rest, d = 2
TRANSFERS = ("mls", "apic", "pic", "flip")


def cloud(x, transfer, rpic=0.0, material=ELASTIC, relaxation=0.0, gimp=0.0):
    """Particles of 0.0025 m^2 at rest at x (N, 2), and their stepper."""
    x = np.array(x, dtype=float)
    n, V = len(x), 0.25 * DX**2
    q = particles_at(x, np.zeros((n, 2)), np.full(n, RHO * V), np.full(n, V), transfer)
    if relaxation:
        q = with_separate_gradient(q)
    body = Body("cloud", q, *material, np.arange(n))
    scheme = Scheme(2, transfer, rpic=rpic, relaxation=relaxation, gimp=gimp)
    stepper = Stepper(scheme, DX, 2, np.zeros(2))
    stepper.start([body])
    return body, stepper


@pytest.mark.parametrize("transfer", TRANSFERS)
@pytest.mark.parametrize(("place", "S"), [(0.0, 4.0), (0.5 - 1e-7, 6.0)])
def test_one_particle_has_the_limit_of_its_recurrence(transfer, place, S):
    body, stepper = cloud([[(3.0 + place) * DX] * 2], transfer)
    load = {"mls": 4.0 / 4.0, "apic": (2.0 * S - 4.0) / 4.0}.get(transfer, S / 2.0)
    limit = DX * sqrt(RHO / (K * load))
    assert stable_dt([body], stepper).single_particle == pytest.approx(limit, rel=1e-5)


def spectral_radius(x, transfer, factor, **of_cloud):
    """Of the linear map that one step at `factor` times the bound makes of (v, C, F) near rest."""
    body, stepper = cloud(x, transfer, **of_cloud)
    dt = factor * stable_dt([body], stepper).single_particle
    rest = [a.copy() for a in body.particles]
    carried = ["v", "F", *(["C"] if stepper.scheme.affine else [])]
    eps, columns = 1e-6, []
    for name in carried:
        for k in range(getattr(body.particles, name).size):
            for a, a0 in zip(body.particles, rest, strict=True):
                a[...] = a0
            field = getattr(body.particles, name)
            field.reshape(-1)[k] += eps
            stepper.start([body])
            stepper.step([body], 0.0, dt)
            after = dict(zip(body.particles._fields, rest, strict=True))
            columns.append(np.concatenate([
                (getattr(body.particles, f) - after[f]).ravel() / eps for f in carried]))
    return np.abs(np.linalg.eigvals(np.array(columns).T)).max()


CLOUDS = {
    "one": [[0.35, 0.349999]],
    "row": [[0.3 + 0.049 * k, 0.345] for k in range(5)],
    "random": np.random.default_rng(4).uniform(0.3, 0.5, (8, 2)),
}


@pytest.mark.parametrize("transfer", TRANSFERS)
@pytest.mark.parametrize("name", CLOUDS)
def test_no_cloud_grows_at_the_bound(transfer, name):
    # 0.99 and 1e-3: at the bound -1, and by rotation 1, are double eigenvalues, which differences
    # split by the root of their error
    assert spectral_radius(CLOUDS[name], transfer, 0.99) <= 1.0 + 1e-3


@pytest.mark.parametrize("transfer", TRANSFERS)
def test_one_particle_grows_past_the_bound(transfer):
    assert spectral_radius(CLOUDS["one"], transfer, 1.05) > 1.01


@pytest.mark.parametrize("transfer", ["apic", "mls"])
@pytest.mark.parametrize("rpic", [0.3, 1.0])
def test_damping_moves_the_bound_of_one_particle(transfer, rpic):
    assert spectral_radius(CLOUDS["one"], transfer, 0.99, rpic=rpic) <= 1.0 + 1e-3
    assert spectral_radius(CLOUDS["one"], transfer, 1.05, rpic=rpic) > 1.01


@pytest.mark.parametrize("transfer", ["apic", "mls"])
@pytest.mark.parametrize("crossings", [0.1, 1.0, 10.0, 1e6])
def test_no_cloud_grows_at_the_bound_with_relaxation(transfer, crossings):
    """relaxation is a number of times dx/c, in which a wave crosses a cell."""
    relaxation = crossings * DX * sqrt(RHO / (LAW.lam + 2.0 * LAW.mu))
    for x in CLOUDS.values():
        assert spectral_radius(x, transfer, 0.99, relaxation=relaxation) <= 1.0 + 1e-3


@pytest.mark.parametrize("transfer", ["pic", "flip"])
@pytest.mark.parametrize(("place", "S"), [(0.0, 8.0), (0.25 - 1e-7, 28.0 / 3.0)])
def test_one_particle_of_gimp_has_the_limit_of_its_recurrence(transfer, place, S):
    """S = 2/l on a node, and 2/l + 1/(1 - l) where its end is on the next: l = 1/4 cells."""
    body, stepper = cloud([[(3.0 + place) * DX] * 2], transfer, gimp=2.0)
    limit = DX * sqrt(RHO / (K * S / 2.0))
    assert stable_dt([body], stepper).single_particle == pytest.approx(limit, rel=1e-5)


@pytest.mark.parametrize("transfer", ["pic", "flip"])
@pytest.mark.parametrize("gimp", [1.5, 2.0, 4.0])
def test_no_cloud_grows_at_the_bound_with_gimp(transfer, gimp):
    for x in CLOUDS.values():
        assert spectral_radius(x, transfer, 0.99, gimp=gimp) <= 1.0 + 1e-3
    assert spectral_radius(CLOUDS["one"], transfer, 1.05, gimp=gimp) > 1.01


def test_relaxation_shortens_the_step_of_apic_alone():
    bounds = {}
    for transfer in ("apic", "mls"):
        for relaxation in (0.0, 1.0):
            body, stepper = cloud(CLOUDS["one"], transfer, relaxation=relaxation)
            bounds[transfer, relaxation] = stable_dt([body], stepper).single_particle
    assert bounds["mls", 1.0] == bounds["mls", 0.0]
    assert bounds["apic", 1.0] == pytest.approx(bounds["apic", 0.0] * sqrt(8.0 / 9.0))


@pytest.mark.parametrize("transfer", TRANSFERS)
@pytest.mark.parametrize("eta", [0.0, 1.0, 5e2, 1e9])
def test_a_viscosity_needs_no_bound(transfer, eta):
    """Yield begins at rest. At 5e2 Pa s a step relaxes about half of the stress."""
    viscous = NeoHookean(4e4, 8e4), HerschelBulkley(0.0, eta)
    for name in ("one", "row"):
        assert spectral_radius(CLOUDS[name], transfer, 0.99, material=viscous) <= 1.0 + 1e-3


def test_largest_modulus_at_rest_is_that_of_dilation():
    assert largest_modulus((1.0, 1.0), LAW) == pytest.approx(K)
    assert largest_modulus((1.0, 1.0, 1.0), LAW) == pytest.approx(2.0 * LAW.mu + 3.0 * LAW.lam)


def test_no_wave_is_stiffer_than_the_largest_modulus(rng):
    body, _ = cloud(rng.uniform(0.3, 0.5, (50, 2)), "mls")
    body.particles.F[:] += rng.uniform(-0.4, 0.4, body.particles.F.shape)
    wave, largest = moduli(body)
    assert np.all(largest >= wave)


def test_dt_past_the_bound_is_refused_with_all_terms():
    terms = stable_dt(*(lambda b, s: ([b], s))(*cloud([[0.3, 0.3]], "mls")))
    refuse(terms.dt, terms)
    with pytest.raises(TooLarge, match=r"past the stable.*1\.001 times.*elastic.*single particle"):
        refuse(1.001 * terms.dt, terms)


@pytest.mark.parametrize("bound", [0.0, 1e-320, 0.5 / MOST_STEPS])
def test_steps_in_which_time_stands_still_are_refused(bound):
    clock, state = Clock(end=1.0, cfl=1.0), SimpleNamespace(t=0.25, frame=1, bound=bound)
    with pytest.raises(TooLarge, match=r"^dt = .* is too small: from t = 0.25 to 1 s there would"):
        next_dt(clock, state, 1.0)
    state.bound = 2.0 / MOST_STEPS
    assert next_dt(clock, state, 1.0) == pytest.approx(2.0 / MOST_STEPS)
