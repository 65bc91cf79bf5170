"""Steps of bodies far from each other: the bits of the dense grid, with the nodes of the matter."""

from dataclasses import replace

import numpy as np
import pytest
from far_bodies import FAST, advanced, dense, far_bodies, sparse
from problems import DT, DX, ball, digest, moving
from threads import by_threads
from variants import slow_but

from mpm_ref import oracle
from mpm_ref.core.boundary import BoxWalls, Collider, Conditions, Prescribed
from mpm_ref.core.levelset import half_space, sphere
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.core.sparse_grid import is_sparse
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.energy_budget import EnergyBudget
from mpm_ref.explicit import Scheme
from mpm_ref.materials import FixedCorotated, NoFlow
from mpm_ref.problem import Clock, Problem
from mpm_ref.simulate import simulate
from mpm_ref.store.checkpoint import digest as digest_of_state
from mpm_ref.store.running import Options, run

STEPS = 220

SCHEMES = {
    "mls-2d": (Scheme(rpic=0.1), 2), "mls-3d": (Scheme(), 3),
    "flip-cubic-2d": (Scheme(3, "flip", flip=0.9), 2), "pic-2d": (Scheme(transfer="pic"), 2),
    "apic-relaxed-2d": (Scheme(transfer="apic", relaxation=2e-3), 2),
    "mls-single-3d": (Scheme(precision="single"), 3),
    "flip-gimp-2d": (Scheme(transfer="flip", flip=0.95, gimp=2.0), 2),
    "mls-f-bar-2d": (Scheme(f_bar=True), 2),
    "apic-f-bar-3d": (Scheme(transfer="apic", f_bar=True), 3),
}


def both(make, steps=STEPS):
    """Digests on sparse and on dense grids, and whether each grid was sparse in the first run."""
    with sparse():
        one, kinds = advanced(make(), steps)
    with dense():
        two, others = advanced(make(), steps)
    assert not any(others)
    return one, two, kinds


@pytest.mark.parametrize("name", slow_but(SCHEMES, "mls-2d", "mls-3d", "flip-gimp-2d"))
def test_bodies_that_meet_have_the_bits_of_a_dense_grid(name):
    """Three islands, then two of them merge, through several sorts; the drop falls far away."""
    scheme, d = SCHEMES[name]
    one, two, kinds = both(lambda: far_bodies(scheme, d))
    assert one == two
    assert kinds[0]


def test_islands_merge_and_a_single_one_is_dense():
    """Two bodies that meet: the grid is sparse until they are close, and then dense."""
    def make():
        problem = far_bodies(cells=24.0, speed=2.5)
        return replace(problem, bodies=problem.bodies[:2])

    one, two, kinds = both(make)
    assert one == two
    assert kinds[0]
    assert not kinds[-1]
    assert kinds == sorted(kinds, reverse=True)


def conditions_of(kind, d):
    """A floor with friction, a moving ball, a region and walls, all touched."""
    up, right = np.eye(d)[-1], np.eye(d)[0]
    floor = Collider(half_space(-3.3 * DX * up, up), "separate", 0.3)
    pusher = Collider(sphere(-6.0 * DX * right, 4.1 * DX), "sticky",
                      motion=Motion(Steady(0.5 * right)))
    region = Prescribed(sphere(21.0 * DX * right, 2.0 * DX), Motion(Steady(-FAST * right)))
    return kind((floor, pusher), (region,), BoxWalls(d * (-30,), (22, *(d - 1) * (None,)), "slip"))


@pytest.mark.parametrize("kind", [Conditions, SurfaceConditions])
def test_conditions_have_the_bits_of_a_dense_grid(d, kind):
    one, two, kinds = both(lambda: far_bodies(d=d, conditions=conditions_of(kind, d)), 120)
    assert one == two
    assert all(kinds[:60])


def test_same_bits_for_any_number_of_threads(d):
    with sparse():
        one, two = by_threads(lambda: advanced(far_bodies(d=d), 80)[0])
    assert one == two


@pytest.mark.parametrize("clock", [Clock(dt=DT, steps=150, every=50),
                                   Clock(end=0.15, interval=0.05)], ids=["fixed dt", "adaptive dt"])
def test_a_resumed_run_has_the_bits_of_the_run(tmp_path, clock):
    """Cut while the grid is sparse, and again."""
    def problem():
        return replace(far_bodies(), clock=clock)

    with dense():
        *_, last = simulate(problem())
    expected = digest_of_state(last.state)
    with sparse():
        for steps in (37, 91, None):
            end = run(problem(), tmp_path / "run.h5", Options(steps=steps, resume=True))
    assert digest_of_state(end.state) == expected


def test_golden_files_have_a_dense_grid(tmp_path):
    """Also where the run of the scene has a sparse one."""
    for name, grids in (("sparse", sparse), ("dense", dense)):
        with grids():
            oracle.record(far_bodies(), tmp_path / f"{name}.h5", 2)
    report = oracle.check(tmp_path / "dense.h5", tmp_path / "sparse.h5")
    assert report.agrees
    assert report.compared > 20


def test_energy_budget_is_that_of_a_dense_grid():
    """The state to the bit; the terms are sums over nodes in another order."""
    budgets = []
    for grids in (sparse, dense):
        budget = EnergyBudget()
        with grids():
            problem = replace(far_bodies(conditions=conditions_of(Conditions, 2)), budget=budget)
            sha, _ = advanced(problem, 60)
        budgets.append((sha, budget.facts()))
    (one, facts), (two, expected) = budgets
    assert one == two
    scale = abs(np.array(list(expected.values()))).max()
    assert list(facts.values()) == pytest.approx(list(expected.values()), abs=1e-11 * scale)


class DenseConditions:
    """Conditions of a user, which read a dense grid."""

    moves = False

    def apply(self, grid, t, dt):
        assert grid.origin.ndim == 1


def test_conditions_that_know_dense_grids_alone_get_these():
    with sparse():
        _, kinds = advanced(far_bodies(conditions=DenseConditions()), 3)
    assert not any(kinds)


# bodies that no dense grid covers

def blocks(d, cells):
    """Two spinning blocks a number of cells away from each other."""
    law, flow = FixedCorotated(4e4, 6e4), NoFlow()
    first = moving(ball("first", np.zeros(d), law, flow), np.zeros(d), 4.0)
    far = np.round(cells) * DX * np.ones(d)
    second = moving(ball("second", far, law, flow), np.zeros(d), -4.0)
    return Problem((first, second), DX, Clock(dt=DT, steps=200), np.zeros(d))


def test_bodies_a_million_cells_away_step_as_each_alone(d):
    """With the nodes of the two: each block has the bits of a run alone."""
    problem = blocks(d, 1e6)
    _, kinds = advanced(problem, 200)
    assert all(kinds)
    for k, body in enumerate(problem.bodies):
        other = blocks(d, 1e6)
        alone = replace(other, bodies=other.bodies[k : k + 1])
        assert advanced(alone, 200)[0] == digest([body])


def test_the_grid_of_bodies_far_away_is_small(d):
    problem = blocks(d, 1e6)
    grid = problem.stepper().storage.cover([body.particles.x for body in problem.bodies])
    assert is_sparse(grid)
    assert grid.m.size <= 2 * 12**d


def test_a_particle_that_flies_off_does_not_end_the_run():
    """It is the monitor's to judge: the grid follows it with a few nodes."""
    problem = blocks(2, 30)
    problem.bodies[0].particles.x[0] += 1e7 * DX
    _, kinds = advanced(problem, 3)
    assert all(kinds)
