"""NCLaw's baselines without PyTorch: splines, stresses in principal stretches, what is stored."""

import numpy as np
import pytest
from adjoints import rate

from mpm_ref import materials
from mpm_ref.core.law import kirchhoff
from mpm_ref.materials.learned import (
    learned_flow,
    learned_law,
    principal,
    response,
    spline,
    stretch_network,
    weights,
)
from mpm_ref.materials.learned.contraction import Contraction
from mpm_ref.materials.learned.energetic import Energetic
from mpm_ref.materials.learned.invariants import spectrum
from mpm_ref.materials.learned.network import NeuralFlow
from mpm_ref.materials.learned.table import TABLES
from mpm_ref.materials.learned.weights import LawWeights, LearnedLaws
from tests.nclaw.test_invariants import APART, REPEATED, H, built, near_rest, turns

X = spline.knots()
FAIR, RELEASED = spline.SplineStress(2.0), spline.ReleasedSplineStress(2.0)
MEAN, SORTED = stretch_network.StretchStress(2.0), stretch_network.ReleasedStretchStress(2.0)
MU, LAM = 3.0, 2.0


def piecewise(pieces, values, x):
    """The function of values at knots, at x (n,)."""
    k = np.searchsorted(pieces.breaks, x)
    return np.array([np.polyval(pieces.basis[m] @ values, t - pieces.origins[m])
                     for m, t in zip(k, x, strict=True)])


def network(rng):
    """Layers 3 -> 6 -> 6 -> 3."""
    sizes = (3, 6), (6, 6), (6, 3)
    return tuple((rng.normal(size=size), rng.normal(size=size[1])) for size in sizes)


def stresses(F, law):
    """tau (n, 3, 3)."""
    return np.array([kirchhoff(tuple(map(tuple, A.tolist())), law) for A in F])


# Splines.

def test_there_are_21_knots_11_up_to_1():
    expected = [k / 10 for k in range(11)] + [1 + 0.9 * k for k in range(1, 11)]
    assert X.tolist() == pytest.approx(expected)


def test_fair_pieces_keep_parabolas():
    """Between knots, at their ends, and beyond."""
    x = np.linspace(-0.5, 11.0, 300)
    found = piecewise(spline.fair(X), 2.0 * X**2 - 3.0 * X + 1.0, x)
    assert found == pytest.approx(2.0 * x**2 - 3.0 * x + 1.0, abs=1e-11)


def test_fair_pieces_go_through_their_values_and_bend_without_a_kink(rng):
    pieces, values, h = spline.fair(X), rng.normal(size=len(X)), 1e-6
    assert piecewise(pieces, values, X) == pytest.approx(values, abs=1e-12)
    inner = X[1:-1]
    left, at, right = (piecewise(pieces, values, inner + e) for e in (-h, 0.0, h))
    assert right - at == pytest.approx(at - left, abs=1e3 * h**2)


def of_release(values, x):
    """The function as the release's formulas have it."""
    y, k = values, np.clip(np.searchsorted(X, x), 0, 9)
    a = np.where(k == 0, (2 * y[0] + 2 * y[1] - y[2]) / 3, y[k] + (y[k + 1] - y[k - 1]) / 6)
    b = y[k + 1] - (y[k + 2] - y[k]) / 6
    t = (x - X[k]) / (X[k + 1] - X[k])
    first = (1 - t) ** 3 - 2.0          # -1 where Bernstein's polynomial has +1
    return first * y[k] + 3 * t * (1 - t) ** 2 * a + 3 * t**2 * (1 - t) * b + t**3 * y[k + 1]


def test_released_pieces_are_those_of_the_release(rng):
    values, x = rng.normal(size=len(X)), np.concatenate([np.linspace(-0.5, 11.0, 300), X])
    found = piecewise(spline.released(X), values, x)
    assert found == pytest.approx(of_release(values, x), rel=1e-9, abs=1e-9)


def test_released_pieces_read_four_values_above_four_fifths():
    basis = spline.released(X).basis
    assert np.flatnonzero(abs(basis[-1]).sum(axis=0)).tolist() == [8, 9, 10, 11]
    assert np.flatnonzero(abs(basis).sum(axis=(0, 1))).tolist() == list(range(12))
    assert spline.released(X).breaks[-1] == 0.8


def test_splines_hold_fixed_corotated_exactly(rng):
    """f = 2 mu (x - 1), g = 0, h = lam (x - 1)."""
    F = near_rest(20, 3, rng)
    values = np.stack([2.0 * MU * (X - 1.0), 0.0 * X, LAM * (X - 1.0)], axis=1) / FAIR.unit
    law = spline.build_law(LawWeights(((values, np.zeros(3)),), FAIR))
    expected = stresses(F, materials.FixedCorotated(MU, LAM))
    assert stresses(F, law) == pytest.approx(expected, abs=1e-11)


def test_splines_read_areas(rng):
    """g alone: of 2 x - 3 P_i = sum_j (2 s_i s_j - 3) s_j."""
    s = np.array([1.3, 1.1, 0.7])
    values = np.stack([0.0 * X, 2.0 * X - 3.0, 0.0 * X], axis=1) / FAIR.unit
    law = spline.build_law(LawWeights(((values, np.zeros(3)),), FAIR))
    y = [sum((2.0 * s[i] * s[j] - 3.0) * s[j] for j in range(3) if j != i) for i in range(3)]
    assert np.diagonal(stresses(np.diag(s)[None], law)[0]) == pytest.approx(y * s)


# Networks.

def plain(layers, s):
    """What a network of s - 1 gives."""
    a = s - 1.0
    for W, b in layers[:-1]:
        a = a @ W + b
        a = np.where(a > 0.0, a, np.exp(a) - 1.0)
    return a @ layers[-1][0] + layers[-1][1]


def test_sorted_network_is_that_of_numpy(rng):
    F, layers = near_rest(9, 3, rng), network(rng)
    of = spectrum(F)
    y = SORTED.unit * plain(layers, of.s)
    expected = of.U @ ((y * of.s)[:, :, None] * of.U.transpose(0, 2, 1))
    law = stretch_network.build_law(LawWeights(layers, SORTED))
    assert stresses(F, law) == pytest.approx(expected)


@pytest.mark.parametrize("s", [(1.2, 1.2, 0.9), (1.2, 0.9, 0.9), (1.1, 1.1, 1.1)])
def test_mean_over_orders_is_isotropic(s, rng):
    """tau(Q F Q') = Q tau(F) Q^T, where stretches are equal too."""
    law = stretch_network.build_law(LawWeights(network(rng), MEAN))
    Q, P = turns(5, 3, rng), turns(5, 3, rng)
    tau = stresses(np.diag(s)[None], law)
    expected = Q @ tau @ Q.transpose(0, 2, 1)
    assert stresses(Q * np.array(s) @ P, law) == pytest.approx(expected, abs=1e-12)


def test_mean_over_orders_is_the_mean(rng):
    layers, s = network(rng), np.array([1.3, 1.0, 0.8])
    y = np.zeros(3)
    for order in ([0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]):
        y[order] += MEAN.unit * plain(layers, s[order]) / 6.0
    tau = stresses(np.diag(s)[None], stretch_network.build_law(LawWeights(layers, MEAN)))
    assert tau[0] == pytest.approx(np.diag(y * s), abs=1e-12)


def test_a_network_of_other_layers_is_refused():
    with pytest.raises(ValueError, match=r"sizes \[\]: expected three"):
        stretch_network.build_law(LawWeights((), MEAN))


def test_every_stored_law_has_a_law_and_a_flow(rng):
    layers = ((rng.normal(size=(13, 9)), np.zeros(9)),)
    assert isinstance(learned_law(beside(FAIR, rng)), spline.SplineLaw)
    assert isinstance(learned_law(beside(SORTED, rng)), stretch_network.StretchNetworkLaw)
    assert isinstance(learned_flow(LawWeights(layers, response.Correction())), NeuralFlow)
    for kind, made in ((materials.Hencky(1.0, 2.0), learned_law),
                       (materials.VonMises(1.0, 0.05), learned_flow),
                       (materials.NoFlow(), learned_flow)):
        assert made(LawWeights((), kind)) is kind
    for kind, made in ((materials.VonMises(1.0, 0.05), learned_law),
                       (response.Correction(), learned_law),
                       (materials.Hencky(1.0, 2.0), learned_flow)):
        with pytest.raises(ValueError, match=type(kind).__name__):
            made(LawWeights((), kind))


# The adjoint.

def others(s):
    """J/s_i (n, d)."""
    return np.stack([np.prod(np.delete(s, i, 1), axis=1) for i in range(s.shape[1])], axis=1)


def isotropic(s):
    """y_i = s_i^2 + J/s_i, and a_ij in closed form."""
    i, j = np.transpose(principal.PAIRS[s.shape[1]])
    rest = s[:, 3 - i - j] if s.shape[1] == 3 else 1.0
    return s**2 + others(s), s[:, i] + s[:, j] - rest


def pulled(y_bar, s):
    """s_bar of `isotropic`: the derivative of J/s_i by s_k is the product of the rest."""
    d, s_bar = s.shape[1], 2.0 * s * y_bar
    for i in range(d):
        for k in set(range(d)) - {i}:
            s_bar[:, k] += y_bar[:, i] * np.prod(np.delete(s, [i, k], 1), axis=1)
    return s_bar


@pytest.mark.parametrize("name", [*APART, *REPEATED])
def test_adjoint_is_exact(name, d, rng):
    """Where stretches are repeated too, as y is isotropic."""
    F = built(name, 6, d, rng)
    G, dF = rng.normal(size=(2, *F.shape))

    def loss(h):
        of = spectrum(F + h * dF)
        return float((G * principal.stresses(isotropic(of.s)[0], of)).sum())

    of = spectrum(F)
    y, ratios = isotropic(of.s)
    y_bar, F_bar = principal.pull_back(G, y, ratios, of)
    F_bar += principal.pull_back_stretches(pulled(y_bar, of.s), of)
    assert rate(loss, float((F_bar * dF).sum()), H) == pytest.approx(2.0, abs=0.1)


def test_ratios_are_exact_but_for_small_gaps():
    s = np.array([[1.2, 1.0, 0.7], [1.1, 1.1, 0.9]])
    y = np.array([[3.0, 1.0, 0.5], [2.0, 1.0, 0.5]])
    found = principal.bounded_ratios(y, s)
    assert found[0] == pytest.approx([10.0, 5.0, 5 / 3])
    assert found[1] == pytest.approx([1.0 / principal.LEAST_GAP, 7.5, 2.5])


# Files.

def beside(kind, rng):
    """`LawWeights` of a kind; records of equal numbers are equal, their types not."""
    sizes = {type(MEAN): ((3, 6), (6, 3)), type(SORTED): ((3, 6), (6, 6), (6, 3)),
             Energetic: ((4, 5), (5, 1)), Contraction: ((3, 5), (5, 2)),
             type(FAIR): ((21, 3),), type(RELEASED): ((21, 3),)}.get(type(kind), ())
    layers = tuple((abs(rng.normal(size=size)), np.zeros(size[1])) for size in sizes)
    return LawWeights(layers, kind)


LAWS = {"elastic": (MEAN, SORTED, FAIR, RELEASED, Energetic(2e4), materials.Fluid(3.0),
                    materials.FixedCorotated(1.0, 2.0), materials.Hencky(1.0, 2.0)),
        "plastic": (materials.NoFlow(), Contraction(2e-3), materials.DruckerPrager(0.3, 0.05),
                    materials.VonMises(5.0, 0.05), materials.FluidProjection())}


def test_every_law_that_is_compared_comes_back_from_a_file(tmp_path, rng):
    assert {part: {type(kind) for kind in kinds} for part, kinds in LAWS.items()} == {
        part: set(kinds) - {*response.STRESSES, *response.CORRECTIONS}
        for part, kinds in TABLES.items()}
    for elastic in LAWS["elastic"]:
        for plastic in LAWS["plastic"]:
            laws = LearnedLaws(beside(elastic, rng), beside(plastic, rng), {})
            weights.save(tmp_path / "laws.npz", laws)
            back = weights.load(tmp_path / "laws.npz")
            assert (back.elastic.kind, back.plastic.kind) == (elastic, plastic)
            assert isinstance(back.elastic.kind, type(elastic))
            assert isinstance(back.plastic.kind, type(plastic))
            for (W, b), (V, c) in zip(back.elastic.layers, laws.elastic.layers, strict=True):
                np.testing.assert_array_equal(W, V)
                np.testing.assert_array_equal(b, c)


@pytest.mark.parametrize(("elastic", "said"), [
    (LawWeights(((np.zeros((20, 3)), np.zeros(3)),), FAIR), r"layers of sizes \[\(20, 3\)\]"),
    (LawWeights((), FAIR), "without layers"),
    (LawWeights(((np.zeros((3, 3)), np.zeros(3)),), materials.Hencky(1.0, 2.0)), "layers of sizes"),
    (LawWeights((), materials.VonMises(5.0, 0.05)), "elastic law of kind VonMises, expected"),
    (LawWeights((), materials.Hencky(1.0, np.nan)), "entries that are not finite"),
])
def test_layers_that_a_kind_has_not_are_refused(tmp_path, elastic, said):
    with pytest.raises(ValueError, match=said):
        weights.save(tmp_path / "laws.npz",
                     LearnedLaws(elastic, LawWeights((), materials.NoFlow()), {}))
