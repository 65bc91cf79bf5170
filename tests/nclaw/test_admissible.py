"""Laws that thermodynamics admits: formulas, what holds by construction, gradients, files."""

import admissible_toys as toys
import numpy as np
import pytest
from adjoints import rate
from admissible_toys import tuples

from mpm_ref.core.law import kirchhoff, psi, returned
from mpm_ref.materials.learned import contraction, energetic, weights
from mpm_ref.materials.learned.contraction import Contraction
from mpm_ref.materials.learned.invariants import spectrum
from mpm_ref.nclaw.bodies import material_points
from mpm_ref.store.weights_file import pack
from mpm_ref.timestep import moduli
from tests.nclaw.test_invariants import REPEATED, built, turns

N, SEEDS = 20, range(5)
ROUND_OFF = 1e-11
H = 1e-3 * 0.5 ** np.arange(5)
STRETCHES = ("generic", *REPEATED)


def strained(rng, size=0.2, n=N):
    """F (n, 3, 3) with det F > 0, strained by about `size`."""
    drawn = np.eye(3) + size * rng.normal(size=(4 * n, 3, 3))
    return drawn[np.linalg.det(drawn) > 0.05][:n]


def energies(law, F):
    return np.array([psi(tuples(A), law) for A in F])


def stresses(law, F):
    return np.array([kirchhoff(tuples(A), law) for A in F])


def after(flow, F):
    return np.array([returned(tuples(A), flow) for A in F])


def logarithms(F):
    """Deviators (n, 3) and traces (n,) of log s."""
    eps = np.log(np.linalg.svd(F, compute_uv=False))
    return eps - eps.mean(axis=1, keepdims=True), eps.sum(axis=1)


# The elastic law.

def test_energy_is_that_of_the_formulas(rng):
    F, (law, _) = strained(rng), toys.deployed()
    expected = [toys.energy(toys.energetic(), A) for A in F]
    assert energies(law, F) == pytest.approx(np.array(expected), rel=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_stress_is_the_slope_of_the_energy(seed, rng):
    """tau : (dF F^-1) = dpsi, by central differences; tau is symmetric."""
    F, (law, _), h = strained(rng), toys.deployed(seed), 1e-5
    dF, tau = rng.normal(size=F.shape), stresses(law, F)
    slope = (energies(law, F + h * dF) - energies(law, F - h * dF)) / (2.0 * h)
    power = np.einsum("pij,pij->p", tau, dF @ np.linalg.inv(F))
    assert power == pytest.approx(slope, rel=1e-6, abs=1e-6 * abs(slope).max())
    assert abs(tau - tau.swapaxes(1, 2)).max() <= 1e-14 * abs(tau).max()


def test_the_body_turns_with_its_stress(rng):
    """From the left tau turns, from the right nothing changes: isotropy."""
    F, Q, (law, flow) = strained(rng), turns(N, 3, rng), toys.deployed()
    tau, left = stresses(law, F), after(flow, F)
    scale = abs(tau).max()
    assert stresses(law, Q @ F) == pytest.approx(Q @ tau @ Q.swapaxes(1, 2), abs=1e-12 * scale)
    assert stresses(law, F @ Q) == pytest.approx(tau, abs=1e-12 * scale)
    assert after(flow, Q @ F) == pytest.approx(Q @ left, abs=1e-12)
    assert after(flow, F @ Q) == pytest.approx(left @ Q, abs=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_rest_is_the_lowest_place(seed, rng):
    """Energy and stress vanish there, nowhere is the energy lower, and it has no bound."""
    law, _ = toys.deployed(seed)
    Q = turns(5, 3, rng)
    assert abs(energies(law, Q)).max() < ROUND_OFF * toys.UNIT
    assert abs(stresses(law, Q)).max() < ROUND_OFF * toys.UNIT
    assert energies(law, strained(rng, 0.5, 100)).min() > 0.0
    crushed = energies(law, np.array([10.0**-k * np.eye(3) for k in (1, 3, 5, 7)]))
    assert (np.diff(crushed) > 0.1 * crushed[0]).all()
    assert energies(law, -np.eye(3)[None]) == [np.inf]


@pytest.mark.parametrize("seed", SEEDS)
def test_energy_is_convex_along_rank_one_lines(seed, rng):
    """As polyconvex ones are, so that waves are real at any strain."""
    law, _ = toys.deployed(seed)
    F, a, b = strained(rng, 0.4, 200), *rng.normal(size=(2, 200, 3))
    d = 1e-3 * a[:, :, None] * b[:, None, :]
    bend = energies(law, F + d) + energies(law, F - d) - 2.0 * energies(law, F)
    assert bend.min() > 0.0


def test_moduli_at_rest_are_those_of_small_strains():
    law, h = toys.deployed()[0], 1e-6
    push, shear = np.eye(3), np.eye(3)
    push[0, 0] += h
    shear[0, 1] += h
    tau, sheared = stresses(law, np.array([push, shear]))
    assert tau[0, 0] / h == pytest.approx(law.lam + 2.0 * law.mu, rel=1e-4)
    assert tau[1, 1] / h == pytest.approx(law.lam, rel=1e-4)
    assert sheared[0, 1] / h == pytest.approx(law.mu, rel=1e-4)
    wave, largest = moduli(material_points(law, toys.deployed()[1], np.eye(3)[None]))
    assert wave == [law.lam + 2.0 * law.mu]
    assert largest == [3.0 * law.lam + 2.0 * law.mu]


# The return map.

def test_returns_are_those_of_the_formulas(rng):
    F, (_, flow) = strained(rng), toys.deployed()
    expected = np.array([toys.returned(toys.contraction(), A) for A in F])
    assert after(flow, F) == pytest.approx(expected, rel=1e-12, abs=1e-13)
    assert abs(expected - F).max() > 0.05


def test_rest_stays_and_compressed_matter_keeps_its_volume(rng):
    flow = toys.deployed()[1]
    Q, F = turns(5, 3, rng), strained(rng, 0.3, 100)
    assert after(flow, Q) == pytest.approx(Q, abs=1e-14)
    J, left = np.linalg.det(F), np.linalg.det(after(flow, F))
    shut = J < 1.0
    assert shut.any()
    assert left[shut] == pytest.approx(J[shut], rel=1e-12)
    assert (left[~shut] < J[~shut]).all()
    assert (left[~shut] > 1.0).all()


@pytest.mark.parametrize("shift", [-8.0, 0.0, 8.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_no_return_adds_energy(seed, shift, rng):
    """Whatever both networks are: psi falls, and tau does work along the way back."""
    law, flow = toys.deployed(seed, shift)
    F = strained(rng, 0.4, 200)
    left = after(flow, F)
    before, found = energies(law, F), energies(law, left)
    assert (found < before).all()
    (e, theta), (e_left, theta_left) = logarithms(F), logarithms(left)
    along = np.argsort(np.linalg.eigvalsh(stresses(law, left)), axis=1)[:, ::-1]
    tau = np.take_along_axis(np.linalg.eigvalsh(stresses(law, left)), along, axis=1)
    flowed = e - e_left + (theta - theta_left)[:, None] / 3.0
    assert np.einsum("pi,pi->p", tau, flowed).min() >= -1e-9 * before.max()


def test_an_energy_that_falls_with_strain_would_be_told(rng):
    """The check above sees a negative weight."""
    of = toys.energetic()
    broken = of._replace(layers=((-of.layers[0][0], of.layers[0][1]), *of.layers[1:]))
    law, flow = energetic.build_law(broken), toys.deployed()[1]
    F = strained(rng)
    assert (energies(law, after(flow, F)) > energies(law, F)).all()


# Gradients.

def order(loss, slope):
    return rate(loss, float(slope), H)


@pytest.mark.parametrize("stretches", STRETCHES)
def test_gradients_of_the_stress_are_exact(stretches, rng):
    F, g = built(stretches, N, 3, rng), rng.normal(size=(N, 4))
    G, dF, dg = *rng.normal(size=(2, N, 3, 3)), rng.normal(size=(N, 4))
    g_bar, F_bar = energetic.pull_back(G, g, F)
    assert order(lambda h: (G * energetic.stresses(g, F + h * dF)).sum(),
                 (F_bar * dF).sum()) == pytest.approx(2.0, abs=0.1)
    moved = ((energetic.stresses(g + dg, F) - energetic.stresses(g, F)) * G).sum()
    assert (g_bar * dg).sum() == pytest.approx(moved, rel=1e-9)
    m_bar = rng.normal(size=(N, 4))
    assert order(lambda h: (m_bar * energetic.measures_of(F + h * dF)).sum(),
                 (energetic.pull_back_measures(m_bar, F) * dF).sum()
                 ) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("stretches", [name for name in STRETCHES if name != "I"])
def test_gradients_of_the_return_are_exact(stretches, rng):
    """At I the size of the deviator has a kink; see the next test."""
    F, c = built(stretches, N, 3, rng), rng.uniform(0.1, 1.0, (N, 2))
    G, dF = rng.normal(size=(2, N, 3, 3))
    dc, x_bar, kind = rng.normal(size=(N, 2)), rng.normal(size=(N, 3)), Contraction(0.1)
    c_bar, F_bar = contraction.pull_back(G, c, spectrum(F))
    assert order(lambda h: (G * contraction.contracted(c, spectrum(F + h * dF))).sum(),
                 (F_bar * dF).sum()) == pytest.approx(2.0, abs=0.1)
    assert order(lambda h: (G * contraction.contracted(c + h * dc, spectrum(F))).sum(),
                 (c_bar * dc).sum()) == pytest.approx(2.0, abs=0.1)
    if stretches != "1.01 I":
        bar = contraction.pull_back_strains(x_bar, spectrum(F), kind)
        assert order(lambda h: (x_bar * contraction.strains_of(spectrum(F + h * dF), kind)).sum(),
                     (bar * dF).sum()) == pytest.approx(2.0, abs=0.1)


def test_at_rest_a_return_has_the_gradient_of_its_shares(rng):
    """F' = F + dF with exp(-a) of the deviator of sym dF, and all of the spin."""
    G, dF = rng.normal(size=(2, N, 3, 3))
    c = rng.uniform(0.1, 1.0, (N, 2))
    F = np.tile(np.eye(3), (N, 1, 1))
    sym, spin = 0.5 * (dF + dF.swapaxes(1, 2)), 0.5 * (dF - dF.swapaxes(1, 2))
    mean = np.trace(sym, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    expected = spin + np.exp(-c[:, :1, None]) * (sym - mean) + mean      # of theta <= 0
    _, F_bar = contraction.pull_back(G, c, spectrum(F))
    assert (F_bar * dF).sum() == pytest.approx((G * expected).sum(), rel=1e-10)


def test_what_is_inverted_gives_nan():
    law, flow = toys.deployed()
    F = np.diag([1.0, 1.0, -0.5])[None]
    assert np.isnan(stresses(law, F)).all()
    assert np.isnan(after(flow, F)).all()


# Files.

def test_laws_come_back_bit_for_bit(tmp_path):
    made = toys.laws()
    weights.save(tmp_path / "laws.npz", made)
    back = weights.load(tmp_path / "laws.npz")
    for part in weights.PARTS:
        one, other = getattr(back, part), getattr(made, part)
        assert one.kind == other.kind
        for a, b in zip(one.layers, other.layers, strict=True):
            assert all(map(np.array_equal, a, b))


def test_a_file_of_negative_weights_is_refused(tmp_path):
    """With them nothing would hold by construction."""
    path, made = tmp_path / "laws.npz", toys.laws()
    arrays = {"format": np.array(weights.FORMAT), "about": np.array("{}"),
              **{name: a for part in weights.PARTS for name, a in
                 weights.law_arrays(part, getattr(made, part)).items()}}
    path.write_bytes(pack(arrays))
    assert weights.load(path).elastic.kind == made.elastic.kind
    arrays["elastic_W1"] = arrays["elastic_W1"] - 1.0
    path.write_bytes(pack(arrays))
    with pytest.raises(ValueError, match="elastic law of an energy with negative weights; train"):
        weights.load(path)
