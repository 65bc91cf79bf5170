"""NCLaw's oracles: true laws whose constants are learned, and laws taught on their answers. Needs
PyTorch.
"""

from math import log

import numpy as np
import pytest
from adjoints import rate
from nclaw_toys import cube

from tests.nclaw.test_invariants import built, near_rest

torch = pytest.importorskip("torch")

from mpm_ref.core.law import kirchhoff  # noqa: E402
from mpm_ref.materials import (  # noqa: E402
    DruckerPrager,
    FixedCorotated,
    Fluid,
    FluidProjection,
    Hencky,
    VonMises,
    make_law,
)
from mpm_ref.materials.learned import response  # noqa: E402
from mpm_ref.nclaw.batched_step import make_nodes, make_world  # noqa: E402
from mpm_ref.nclaw.train import labeled  # noqa: E402
from mpm_ref.nclaw.train.fit import train  # noqa: E402
from mpm_ref.nclaw.train.identified_laws import (  # noqa: E402
    START,
    IdentifiedFlow,
    IdentifiedLaw,
    identified_laws,
)
from mpm_ref.nclaw.train.labeled import labels_of, train_labeled  # noqa: E402
from mpm_ref.nclaw.train.neural_laws import describe  # noqa: E402
from mpm_ref.nclaw.train.observations import Trajectory  # noqa: E402
from mpm_ref.nclaw.train.recipe import Recipe  # noqa: E402
from mpm_ref.nclaw.train.rollout import LawPair, step  # noqa: E402
from mpm_ref.nclaw.train.train import drawn_laws  # noqa: E402
from validation.nclaw.trained_laws import nets  # noqa: E402
from validation.training.nclaw import untrained_laws  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")

UNIT = Hencky(0.4, 0.3)             # of E = 1 Pa, but for what nu that would be
LOG_E, SMALL = 2.0, 0.7             # of single stages
E, TAU_Y, STEPS = 1e5, 2e3, 30      # of a run
TRUE = Hencky(0.4 * E, 0.3 * E)
H = 1e-3 * 0.5 ** np.arange(5)


@pytest.fixture(scope="module")
def run():
    """`World` and `Trajectory` of a small cube that yields, and its constants."""
    q, where = cube(STEPS).bodies[0].particles, make_world(cube(STEPS))
    laws, on = yielding(log(E), TAU_Y), make_nodes(where, 1)
    states = [tuple(torch.from_numpy(a.copy())[None] for a in (q.x, q.v, q.C, q.F))]
    with torch.no_grad():
        for _ in range(STEPS):
            states.append(step(laws, where, states[-1], on))
    return where, Trajectory(*map(torch.cat, zip(*states, strict=True)))


def yielding(log_E, tau_y):
    """`LawPair` of a return map on an elastic law."""
    elastic = IdentifiedLaw(UNIT, log_E)
    return LawPair(elastic, IdentifiedFlow(elastic, VonMises(tau_y, 0.05)))


def plasticine():
    """tau of what a return map leaves, as a function of trial F, and what is learned."""
    elastic, plastic = yielding(LOG_E, SMALL)
    return lambda F: elastic(plastic(F)), [elastic.log_E, plastic.log_own]


# True laws.

def test_known_stress_is_that_of_the_law(rng):
    F = near_rest(9, 3, rng)
    law = Hencky(*(np.exp(LOG_E) * np.array(UNIT)))
    expected = [kirchhoff(tuple(map(tuple, A.tolist())), law) for A in F]
    with torch.no_grad():
        found = IdentifiedLaw(UNIT, LOG_E)(torch.from_numpy(F)).numpy()
    assert found == pytest.approx(np.array(expected), rel=1e-12)


def test_known_return_keeps_the_yield_stress(rng):
    """NCLAW-eq19: |dev tau| <= tau_y, and what is inside stays."""
    stress, _ = plasticine()
    F = torch.from_numpy(np.concatenate([near_rest(9, 3, rng), 1.01 * built("I", 3, 3, rng)]))
    with torch.no_grad():
        tau = stress(F)
    dev = tau - torch.diagonal(tau, dim1=1, dim2=2).mean(1)[:, None, None] * torch.eye(3)
    sizes = torch.linalg.matrix_norm(dev).numpy()
    assert sizes[:9] == pytest.approx(np.full(9, SMALL))
    assert sizes[9:] == pytest.approx(np.zeros(3), abs=1e-12)


def test_gradient_by_F_is_exact(rng):
    stress, _ = plasticine()
    G, dF = (torch.from_numpy(rng.normal(size=(6, 3, 3))) for _ in range(2))
    F = torch.from_numpy(built("generic", 6, 3, rng)).requires_grad_()
    slope, = torch.autograd.grad((G * stress(F)).sum(), F)

    def moved(h):
        with torch.no_grad():
            return float((G * stress(F + h * dF)).sum())

    assert rate(moved, float((slope * dF).sum()), H) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("k", [0, 1], ids=["E", "tau_y"])
def test_gradient_by_constants_is_exact(k, rng):
    """Young's modulus is read by the stress and by the return map."""
    stress, learned = plasticine()
    F, G = torch.from_numpy(near_rest(6, 3, rng)), torch.from_numpy(rng.normal(size=(6, 3, 3)))
    slope, = torch.autograd.grad((G * stress(F)).sum(), learned[k])

    def moved(h):
        with torch.no_grad():
            learned[k] += h
            value = float((G * stress(F)).sum())
            learned[k] -= h
        return value

    assert rate(moved, float(slope.sum()), H) == pytest.approx(2.0, abs=0.1)


def test_constants_begin_as_in_the_release():
    """log E at 0.8 of its value, yield stress and friction angle too."""
    jelly, sand, plastic = (untrained_laws(nets()[f"{name}-sys-id"]) for name in ("jelly", "sand",
                                                                                  "plasticine"))
    assert jelly.elastic.weights().kind == pytest.approx(make_law("fixed_corotated", E=1e4,
                                                                    nu=0.2))
    assert sand.elastic.log_E.item() == pytest.approx(0.8 * log(1e6))
    sine = np.sin(np.radians(20.0))
    slope, s_min = sand.plastic.weights().kind
    assert (slope, s_min) == (pytest.approx(np.sqrt(2 / 3) * 2 * sine / (3 - sine)), 0.05)
    assert plastic.plastic.weights().kind == (pytest.approx(4e3), 0.05)


def test_fluid_keeps_what_its_pressure_needs(rng):
    """No constant of the projection is learned."""
    elastic, plastic = identified_laws(Fluid(0.5), 100.0, FluidProjection())
    F = torch.from_numpy(near_rest(5, 3, rng))
    with torch.no_grad():
        after = plastic(F)
    J = torch.linalg.det(F)
    assert torch.linalg.det(after).tolist() == pytest.approx(J.tolist())
    stretch = (J ** (2 / 3))[:, None, None] * torch.eye(3)
    assert (after.mT @ after).numpy() == pytest.approx(stretch.numpy(), abs=1e-12)
    assert plastic.log_own.numel() == 0
    assert elastic.log_E.item() == pytest.approx(0.8 * log(100.0))


def test_constants_that_are_not_learned_are_told():
    """In checkpoints: which law, Poisson's ratio, which flow, and its s_min."""
    small, large = VonMises(TAU_Y, 0.05), VonMises(2.0 * TAU_Y, 0.05)

    def told(unit=UNIT, E=E, flow=small):
        return [describe(law) for law in identified_laws(unit, E, flow)]

    assert told(E=2.0 * E, flow=large) == told()
    others = [told(unit=Hencky(0.4, 0.2)), told(unit=FixedCorotated(*UNIT)),
              told(flow=VonMises(TAU_Y, 0.1)), told(flow=DruckerPrager(TAU_Y, 0.05))]
    assert told() not in others


def test_constants_are_found_from_motion(run):
    """Those with which the run was made; each at least twice as near as at the start."""
    laws = identified_laws(UNIT, E, VonMises(START * TAU_Y, 0.05))

    def off():
        learned = laws.elastic.log_E.item(), laws.plastic.log_own.item()
        return abs(np.array(learned) - np.log((E, TAU_Y)))

    first = off()
    recipe = Recipe(epochs=60, elastic_rate=0.2, plastic_rate=0.05, first=STEPS, last=STEPS)
    session = train(recipe, laws, *run)
    assert (off() < 0.5 * first).all()
    assert session.history[-1].error < 0.02 * session.history[0].error


# Labels.

def test_labels_are_answers_of_the_laws(run):
    where, trajectory = run
    labels, laws = labels_of(trajectory, TRUE, where.dt), yielding(log(E), TAU_Y)
    assert labels.F.shape == (STEPS * 27, 3, 3)
    assert float(abs(labels.trial - labels.F_new).max()) > 1e-3
    with torch.no_grad():
        assert labels.tau.numpy() == pytest.approx(laws.elastic(labels.F).numpy(), abs=1e-8)
        assert labels.F_new.numpy() == pytest.approx(laws.plastic(labels.trial).numpy(), abs=1e-12)


def test_laws_learn_their_labels(run):
    """To the same numbers each time."""
    where, trajectory = run
    labels, told = labels_of(trajectory, TRUE, where.dt), []
    for _ in range(2):
        laws = drawn_laws("labeled", 0, response.Stress(1e3), response.Correction(1e-2))
        recipe = Recipe(epochs=30, elastic_rate=0.1, plastic_rate=0.1)
        told.append(train_labeled(recipe, laws, where, labels).history)
    assert told[0] == told[1]
    assert told[0][-1].loss < 0.5 * told[0][0].loss
    assert told[0][-1].error < 0.5 * told[0][0].error


def test_teaching_that_was_cut_off_goes_on_bit_for_bit(tmp_path, monkeypatch, run):
    monkeypatch.setattr(labeled, "SAVE", 2)
    where, epochs = run[0], []
    labels, recipe = labels_of(run[1], TRUE, where.dt), Recipe(epochs=5)

    def taught(seed, *more):
        laws = drawn_laws("labeled", seed, response.Stress(1e3), response.Correction(1e-2))
        session = train_labeled(recipe, laws, where, labels, *more)
        return session.history, [a.tolist() for law in laws for a in law.parameters()]

    def cut(history):
        epochs.append(len(history))
        if epochs == [1, 2, 3]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        taught(0, tmp_path / "a.pt", cut)
    assert taught(7, tmp_path / "a.pt", cut) == taught(0)
    assert epochs == [1, 2, 3, 3, 4, 5]
