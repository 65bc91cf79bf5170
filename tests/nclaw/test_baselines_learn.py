"""NCLaw's baselines as they are trained: exact gradients, and what is stored answers alike. Needs
PyTorch.
"""

import json

import numpy as np
import pytest
from adjoints import rate
from scipy.special import erf

from tests.nclaw.test_invariants import APART, REPEATED, H, built, near_rest

torch = pytest.importorskip("torch")

from mpm_ref.core.law import kirchhoff  # noqa: E402
from mpm_ref.materials import NoFlow  # noqa: E402
from mpm_ref.materials.learned import (  # noqa: E402
    learned_law,
    response,
    spline,
    stretch_network,
    weights,
)
from mpm_ref.materials.learned.invariants import invariants, rotations, spectrum  # noqa: E402
from mpm_ref.nclaw.train.neural_laws import describe  # noqa: E402
from mpm_ref.nclaw.train.principal_laws import ReleasedStretchLawModule, StretchLawModule  # noqa: E402
from mpm_ref.nclaw.train.train import METHODS, drawn_laws  # noqa: E402
from validation.nclaw.environments import ENVIRONMENTS  # noqa: E402
from validation.nclaw.trained_laws import LawNet, identity, nets  # noqa: E402
from validation.training.nclaw import untrained_laws  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("one_torch_thread")]

KINDS = {"spline": spline.SplineStress(2.0), "released spline": spline.ReleasedSplineStress(2.0),
         "neural": stretch_network.StretchStress(2.0),
         "released neural": stretch_network.ReleasedStretchStress(2.0)}
ABLATIONS = {"no rotation": (response.PlainStress(2.0), response.PlainCorrection(0.3)),
             "no undeformed": (response.Stress(2.0), response.Correction(0.3))}


def law_of(name, rng):
    """An elastic law with random weights."""
    law = drawn_laws(name.split()[-1], 3, KINDS[name], None).elastic
    with torch.no_grad():
        for own in law.parameters():
            own.copy_(torch.from_numpy(rng.normal(size=own.shape)))
    return law


def order(law, F, rng):
    """Observed order of the remainder of <G, law(F)>, in a direction of F."""
    G, dF = (torch.from_numpy(rng.normal(size=F.shape)) for _ in range(2))
    F = torch.from_numpy(F).requires_grad_()
    loss = (G * law(F)).sum()
    slope, = torch.autograd.grad(loss, F)

    def moved(h):
        with torch.no_grad():
            return float((G * law(F + h * dF)).sum())

    return rate(moved, float((slope * dF).sum()), H / 10.0)


# The laws.

@pytest.mark.parametrize("stretches", ["generic", *REPEATED])
@pytest.mark.parametrize("name", ["neural", "spline", "released spline"])
def test_gradient_is_exact(name, stretches, rng):
    """Stretches keep off the knots, where the second derivative jumps."""
    F = 0.97 * built(stretches, 5, 3, rng)
    assert order(law_of(name, rng), F, rng) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("stretches", ["generic", "inverted"])
def test_gradient_of_the_released_network_is_exact_where_there_is_one(stretches, rng):
    law = law_of("released neural", rng)
    assert order(law, built(stretches, 5, 3, rng), rng) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("name", KINDS)
def test_gradient_by_weights_is_exact(name, rng):
    """tau is linear in the values of splines."""
    law, F = law_of(name, rng), torch.from_numpy(near_rest(5, 3, rng))
    G = torch.from_numpy(rng.normal(size=F.shape))
    own = list(law.parameters())
    way = [torch.from_numpy(rng.normal(size=p.shape)) for p in own]
    slopes = torch.autograd.grad((G * law(F)).sum(), own)

    def moved(h):
        with torch.no_grad():
            for p, q in zip(own, way, strict=True):
                p += h * q
            value = float((G * law(F)).sum())
            for p, q in zip(own, way, strict=True):
                p -= h * q
        return value

    slope = float(sum((a * b).sum() for a, b in zip(slopes, way, strict=True)))
    assert (moved(1e-5) - moved(-1e-5)) / 2e-5 == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("name", KINDS)
def test_stored_law_answers_as_the_trained_one(name, rng):
    law = law_of(name, rng)
    stored = learned_law(law.weights())
    for stretches in APART:
        F = built(stretches, 4, 3, rng)
        tau = [kirchhoff(tuple(map(tuple, A.tolist())), stored) for A in F]
        with torch.no_grad():
            assert law(torch.from_numpy(F)).numpy() == pytest.approx(np.array(tau), rel=1e-9)


# Ablations.

def network(layers, a):
    """What layers with GELU between them give."""
    for W, b in layers[:-1]:
        z = a @ W + b
        a = 0.5 * z * (1.0 + erf(z / np.sqrt(2.0)))
    return (a @ layers[-1][0] + layers[-1][1]).reshape(-1, 3, 3)


@pytest.mark.parametrize("method", ABLATIONS)
def test_stored_ablation_answers_as_the_trained_one(method, rng):
    """What is stored of "no rotation" reads F - I, of "no undeformed" the usual numbers."""
    F = near_rest(7, 3, rng)
    of = spectrum(F)
    plain = method == "no rotation"
    read = (F - np.eye(3)).reshape(-1, 9) if plain else invariants(F, of)
    for law in drawn_laws(method, 0, *ABLATIONS[method]):
        trained = law.weights()
        expected = response.answers(network(trained.layers, read), F, rotations(of), trained.kind)
        with torch.no_grad():
            assert law(torch.from_numpy(F)).numpy() == pytest.approx(expected, abs=1e-5)


def test_no_undeformed_has_stress_at_rest():
    rest = torch.eye(3, dtype=torch.float64)[None]
    for method, kinds in ABLATIONS.items():
        with torch.no_grad():
            tau = drawn_laws(method, 0, *kinds).elastic(rest)
        assert (float(abs(tau).max()) > 0.1) == (method == "no undeformed")


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize("method", ABLATIONS)
def test_gradient_of_an_ablation_is_exact(method, rng):
    for law in drawn_laws(method, 0, *ABLATIONS[method]):
        law.double()
        assert order(law, built("generic", 5, 3, rng), rng) == pytest.approx(2.0, abs=0.15)


# What is told of laws.

def told(name, change=1.0, seed=0):
    """Of a law with its constants multiplied."""
    elastic, plastic = ABLATIONS.get(name) or (KINDS[name], NoFlow())
    kinds = (type(kind)(*(change * a for a in kind)) for kind in (elastic, plastic))
    method = name if name in ABLATIONS else name.split()[-1]
    return [describe(law) for law in drawn_laws(method, seed, *kinds)]


def test_no_two_laws_are_told_alike():
    every = [str(told(name, change)) for name in (*KINDS, *ABLATIONS) for change in (1.0, 2.0)]
    assert len(set(every)) == len(every)
    one, other = (describe(law(KINDS["neural"]))
                  for law in (StretchLawModule, ReleasedStretchLawModule))
    assert one != other


@pytest.mark.parametrize("name", [*KINDS, *ABLATIONS])
def test_what_is_learned_is_not_told(name):
    assert told(name, seed=1) == told(name) == json.loads(json.dumps(told(name)))


# The nets.

def test_nets_of_ours_are_told_as_ever():
    """Their weights are known by it."""
    for name in ENVIRONMENTS:
        told = identity(nets()[name])
        assert list(told) == ["scene", "environment", "elastic", "plastic", "epochs", "reading",
                              "seed"]
        assert list(told.values())[1:] == [name, "Stress", "Correction", 300, "release", 0]


def test_no_two_nets_are_told_alike():
    told = [str(identity(net)) for net in nets().values()]
    assert len(set(told)) == len(told)


@pytest.mark.parametrize("name", [name for name, net in nets().items() if isinstance(net, LawNet)])
def test_every_net_begins_and_is_stored(name, tmp_path):
    """With the method and the kinds that it names."""
    net = nets()[name]
    stored = weights.LearnedLaws(*(law.weights() for law in untrained_laws(net)), identity(net))
    weights.save(tmp_path / "laws.npz", stored)
    back = weights.load(tmp_path / "laws.npz")
    kinds = [type(law.kind).__name__ for law in (back.elastic, back.plastic)]
    assert kinds == [net.elastic, net.plastic]
    assert back.about == identity(net)
    assert net.method in {*METHODS, "sys-id"}


def test_laws_begin_the_same_of_one_seed():
    kinds = response.Stress(), response.Correction()
    for method in ("ours", "labeled", "no undeformed"):
        one, same, other = (drawn_laws(method, seed, *kinds).plastic.weights().layers[0][0]
                            for seed in (0, 0, 1))
        assert (one == same).all()
        assert not (one == other).any()
