"""Runs of one body, recorded step by step."""

from dataclasses import replace

import numpy as np
import pytest
from problems import DT, DX, METAL, ball, moving, two_disks

from mpm_ref import simulate
from mpm_ref.explicit import Scheme
from mpm_ref.materials import NoFlow, make_flow, make_law
from mpm_ref.problem import Clock, Problem
from mpm_ref.trajectories import BodyHistory, Observed, history, observed, recorded

STEPS = 5


def metal(transfer="mls", **clock):
    """A plastic disk that spins and falls; its particles are not in the order of cells."""
    flow = make_flow("von_mises", METAL, 2, sigma_y=50.0)
    body = moving(ball("metal", (0.33, 0.36), METAL, flow, transfer=transfer), (0.2, -3.0), 9.0)
    clock = Clock(**{"dt": DT, "steps": STEPS, "every": 1, **clock})
    return Problem((body,), DX, clock, np.array((0.0, -9.8)), Scheme(transfer=transfer),
                   title="metal")


def alone(problem):
    """The states of a run that is stepped by hand, without sorting: what is carried."""
    stepper, body = problem.stepper(), problem.bodies[0]
    stepper.start(problem.bodies)
    yield [getattr(body.particles, name).copy() for name in Observed._fields]
    for k in range(STEPS):
        stepper.step(problem.bodies, k * DT, DT)
        yield [getattr(body.particles, name).copy() for name in Observed._fields]


def test_a_run_is_observed_in_full():
    """All that particles carry, return map included; points stay in their own order."""
    found = observed(metal())
    expected = Observed(*map(np.array, zip(*alone(metal()), strict=True)))
    assert found.x.shape == (STEPS + 1, len(metal().bodies[0].id), 2)
    for name, a, b in zip(Observed._fields, found, expected, strict=True):
        assert a.shape == b.shape
        assert a == pytest.approx(b, rel=1e-12, abs=1e-12 * abs(b).max()), name
    assert abs(found.C[1:]).max() > 1.0
    growth = np.eye(2) + DT * found.C[1:]
    assert abs(found.F[1:] - growth @ found.F[:-1]).max() > 1e-4       # yielding


def test_points_stay_in_their_own_order_although_runs_sort_them(monkeypatch):
    scrambled, order = metal(), np.random.default_rng(0).permutation(len(metal().bodies[0].id))
    body = scrambled.bodies[0]
    for name in ("x", "v"):
        getattr(body.particles, name)[:] = getattr(body.particles, name)[order]
    body.id[:] = order
    monkeypatch.setattr(simulate, "SORT", 2)
    found, plain = observed(scrambled), observed(metal())
    assert not np.array_equal(body.id, np.arange(len(order)))
    for a, b in zip(found, plain, strict=True):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-9)


def test_histories_are_less_and_of_fewer_points():
    whole, found = observed(metal()), history(metal())
    assert isinstance(found, BodyHistory)
    for name in ("x", "F", "v"):
        assert np.array_equal(getattr(found, name), getattr(whole, name))
        thin = recorded(metal(), Observed, every=7)
        assert np.array_equal(getattr(thin, name), getattr(whole, name)[:, ::7])


def test_bodies_without_an_affine_field_are_refused():
    with pytest.raises(ValueError, match=r"^'metal': a body that carries no C: expected the "
                                         "transfer apic or mls"):
        observed(metal("pic"))


def falling_water():
    """A disk of water that carries J alone."""
    body = moving(ball("water", (0.33, 0.36), make_law("fluid", E=1e4, nu=0.3), NoFlow()),
                  (0.2, -3.0), 9.0)
    n = len(body.id)
    alone = body.particles._replace(F=np.ones(n), tau=np.zeros(n))
    return replace(metal(), bodies=(body._replace(particles=alone),))


def test_a_fluid_is_observed_as_one_that_only_changed_its_size():
    J, found = history(falling_water()).F, observed(falling_water()).F
    assert J.ndim == 2
    assert abs(J - 1.0).max() > 1e-4
    assert found == pytest.approx(np.sqrt(J)[..., None, None] * np.eye(2))


@pytest.mark.parametrize("of", [observed, history])
@pytest.mark.parametrize(("clock", "said"), [
    ({"every": 2}, "^frame 1 is step 2: expected every = 1$"),
    ({"dt": None}, "^the time step is adaptive: expected a fixed dt$"),
])
def test_runs_that_do_not_show_every_step_are_refused(of, clock, said):
    with pytest.raises(ValueError, match=said):
        of(metal(**clock))


@pytest.mark.parametrize("of", [observed, history])
def test_two_bodies_are_refused(of):
    with pytest.raises(ValueError, match=r"^2 bodies: expected one$"):
        of(two_disks())
