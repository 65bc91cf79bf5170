"""Gradients of runs through networks as materials, without PyTorch (`tape.Tape`)."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from adjoints import rate
from variants import slow_but

from mpm_ref.body import Body, particles_at
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, NoFlow
from mpm_ref.materials.learned.guard import StrainBox, guarded
from mpm_ref.materials.learned.network import build_flow, build_law, with_single_layers
from mpm_ref.materials.learned.response import (
    Correction,
    PlainCorrection,
    PlainStress,
    Stress,
    SymmetricStress,
)
from mpm_ref.materials.learned.weights import LawWeights
from mpm_ref.tape import Seed, Tape

COUNT, STEPS, DX, DT = 20, 6, 0.05, 1e-3
UNIT, ALPHA = 1e3, 0.02             # large enough to matter in a few steps


class Case(NamedTuple):
    """A number of dimensions, a transfer, and the kinds of both laws."""

    d: int
    transfer: str
    elastic: tuple
    plastic: tuple | None


CASES = {
    "plane": Case(2, "apic", Stress(UNIT), Correction(ALPHA)),
    "plane, no return map": Case(2, "flip", SymmetricStress(UNIT), None),
    "space": Case(3, "mls", Stress(UNIT), Correction(ALPHA)),
    "space, without R": Case(3, "pic", PlainStress(UNIT), PlainCorrection(ALPHA)),
}


def weights(d, kind, seed):
    """`LawWeights` of two hidden layers with biases, drawn from a seed."""
    rng = np.random.default_rng(seed)
    inputs = d * d if isinstance(kind, PlainStress | PlainCorrection) else d + d * d + 1
    sizes = inputs, 8, 6, d * d
    return LawWeights(tuple((rng.normal(size=(n, m)) / np.sqrt(n), 0.1 * rng.normal(size=m))
                            for n, m in pairwise(sizes)), kind)


def cloud(case, name, seed):
    """A strained body of points around the middle, without laws."""
    rng, d = np.random.default_rng(seed), case.d
    x = 0.5 + 0.1 * (rng.random((COUNT, d)) - 0.5)
    q = particles_at(x, rng.normal(size=(COUNT, d)), np.full(COUNT, 1e-3), np.full(COUNT, 1e-6),
                     case.transfer)
    q.F[:] += 0.1 * rng.normal(size=q.F.shape)
    return Body(name, q, FixedCorotated(3e2, 5e2), NoFlow(), np.arange(COUNT))


def bodies_of(case):
    """A body of networks, and an elastic one on the same grid."""
    flow = NoFlow() if case.plastic is None else build_flow(weights(case.d, case.plastic, 2))
    law = build_law(weights(case.d, case.elastic, 1))
    return cloud(case, "learned", 0)._replace(law=law, flow=flow), cloud(case, "elastic", 1)


def taped(case, h=0.0, direction=(), every=1):
    """The `Tape` of a run from a start that is moved by h times a direction (x, v, F)."""
    bodies = bodies_of(case)
    for name, change in zip("xvF", direction):
        getattr(bodies[0].particles, name)[:] += h * change
    stepper = Stepper(Scheme(transfer=case.transfer), DX, case.d, np.zeros(case.d))
    stepper.start(bodies)
    tape = Tape(stepper, bodies, every)
    for n in range(STEPS):
        tape.step(n * DT, DT)
    return tape


def seeds_of(case):
    """Random seeds of both bodies after the last step."""
    rng, d = np.random.default_rng(5), case.d
    return [Seed(x=rng.normal(size=(COUNT, d)), F=rng.normal(size=(COUNT, d, d)),
                 tau=1e-2 * rng.normal(size=(COUNT, d, d))) for _ in range(2)]


def loss(case, tape):
    """The linear loss whose gradient after the last step is `seeds_of`."""
    return sum((getattr(body.particles, name) * getattr(seed, name)).sum()
               for body, seed in zip(tape.bodies, seeds_of(case)) for name in ("x", "F", "tau"))


@pytest.mark.parametrize("name", slow_but(CASES, "plane", "space"))
def test_remainder_is_of_second_order_in_the_start(name):
    case = CASES[name]
    rng, d = np.random.default_rng(6), case.d
    direction = (1e-3 * rng.normal(size=(COUNT, d)), rng.normal(size=(COUNT, d)),
                 rng.normal(size=(COUNT, d, d)))
    gradient = taped(case).gradient({STEPS: seeds_of(case)}).bodies[0]
    slope = sum((getattr(gradient, name) * change).sum()
                for name, change in zip("xvF", direction))
    found = rate(lambda h: loss(case, taped(case, h, direction)), slope,
                 4e-3 * 0.5 ** np.arange(5))
    assert found == pytest.approx(2.0, abs=0.1)


def test_laws_of_networks_have_no_gradient_of_their_own():
    case = CASES["plane"]
    learned, elastic = taped(case).gradient({STEPS: seeds_of(case)}).bodies
    assert learned.law is None
    assert learned.flow is None
    assert elastic.law.mu != 0.0


def test_states_between_are_computed_anew():
    case = CASES["plane"]
    whole, few = (taped(case, every=every).gradient({STEPS: seeds_of(case)}) for every in (1, 4))
    for a, b in zip(whole.bodies, few.bodies):
        assert np.array_equal(a.F, b.F)
        assert np.array_equal(a.x, b.x)


def test_a_law_with_a_guard_is_refused():
    body, _ = bodies_of(CASES["plane"])
    box = StrainBox(np.full(3, 0.5), np.full(3, 2.0))
    stepper = Stepper(Scheme(transfer="apic"), DX, 2, np.zeros(2))
    cut = body._replace(law=guarded(body.law, box))
    stepper.start((cut,))
    with pytest.raises(ValueError, match="NeuralStress cuts its strains to a box, which has no"):
        Tape(stepper, (cut,))


def test_layers_in_single_precision_are_refused():
    body, _ = bodies_of(CASES["plane"])
    stepper = Stepper(Scheme(transfer="apic"), DX, 2, np.zeros(2))
    single = body._replace(law=with_single_layers(body.law))
    stepper.start((single,))
    with pytest.raises(ValueError, match="NeuralStress has layers in single precision, which"):
        Tape(stepper, (single,))
