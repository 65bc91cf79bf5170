"""States in the middle of HOT's scenes, and ratios of times and errors of their experiments."""

from dataclasses import replace

import numpy as np
import pytest

from mpm_ref.hot.methods import printed
from mpm_ref.scene import Body, Box, Material, Regular, Scene, Scheme, build
from mpm_ref.simulate import SORT, simulate
from mpm_ref.store.checkpoint import digest
from validation.common import targets
from validation.hot import warm_states as states
from validation.hot.overview import (
    ABLATION,
    FLEXIBLE,
    METHODS,
    MethodCost,
    options,
    overview,
    solver,
)
from validation.trade.hot_start import carry_increments, start_increments


def falling():
    """A block that is thrown and falls, implicitly: a few particles in two dimensions."""
    block = Body(name="block", density=1000.0, shape=Box(lower=[0.0, 0.0], upper=[0.2, 0.2]),
                 sampling=Regular(per_cell=2), material=Material(law="neo_hookean", E=1e5, nu=0.3))
    return Scene(dim=2, dx=0.1, gravity=[0.0, -9.8], integrator="hot", cfl=0.6, longest=0.01,
                 end=0.1, interval=0.015, scheme=Scheme(transfer="apic"), body=(block,))


@pytest.fixture
def cache(monkeypatch, tmp_path):
    """An empty folder for the states of the scene "block" after 0.03 s."""
    monkeypatch.setitem(states.START_TIMES, "block", 0.03)
    monkeypatch.setattr(states, "scene", lambda name, profile: falling())
    monkeypatch.setattr(states.platformdirs, "user_cache_dir", lambda name: tmp_path)
    return tmp_path


def same(a, b):
    return digest(a) == digest(b)


def test_a_stored_state_is_the_computed_one(cache, monkeypatch):
    _, state = states.warm_state("block", "quick")
    assert state.t >= 0.03 > state.t - 0.01
    assert len(list(cache.rglob("block-*.h5"))) == 1
    monkeypatch.setattr(states, "march_to", lambda *_: pytest.fail("computed again"))
    _, again = states.warm_state("block", "quick")
    assert same(state, again)


def test_the_state_of_a_damaged_file_is_computed_again(cache):
    _, state = states.warm_state("block", "quick")
    file, = cache.rglob("block-*.h5")
    file.write_bytes(file.read_bytes()[:-100])
    _, again = states.warm_state("block", "quick")
    assert same(state, again)
    assert same(states.warm_state("block", "quick")[1], state)


def test_a_state_is_computed_where_no_folder_can_be_made(cache):
    (cache / "warm_states").write_text("a file in its place")
    _, state = states.warm_state("block", "quick")
    assert state.t >= 0.03


def test_a_scene_that_ends_before_is_refused():
    with pytest.raises(ValueError, match=r"ends at 0\.1 s, before 1 s"):
        states.march_to(build(falling()), 1.0)


def test_old_versions_are_removed(tmp_path):
    for k in range(6):
        (tmp_path / "warm_states" / f"old{k}").mkdir(parents=True)
    assert states.cache_folder(tmp_path).is_dir()
    assert len(list((tmp_path / "warm_states").iterdir())) == states.VERSIONS


def test_steps_are_those_of_the_run(cache):
    expected = []
    list(simulate(build(falling()), on_step=lambda s, dt: expected.append((s.t, dt))))
    problem, state = states.warm_state("block", "quick")
    assert state.t == expected[3][0] == pytest.approx(0.03)
    steps = [(state.t + step.dt, step.dt) for step in states.following_steps(problem, state, 3)]
    np.testing.assert_array_equal(steps, expected[4:7])
    assert {round(dt, 6) for _, dt in expected} == {0.0075, 0.01}
    assert state.step < SORT


def cost(method, cpu, step, converged=True):
    return MethodCost("wheel", method, step, 0.0, cpu, 5, 7, 0, 6, converged)


def test_overview_of_steps():
    rows = [cost("hot", 1.0, 0), cost("pn-pcg", 2.0, 0, False), cost("hot", 3.0, 1),
            cost("pn-pcg", 12.0, 1)]
    o = overview(rows, "pn-pcg", 10, 20)
    assert (o.total, o.worst, o.cpu, o.capped, o.steps) == (3.5, 4.0, 7.0, 1, 2)
    assert overview(rows, "hot", 10, 20).worst == 1.0


def test_gast_alone_has_a_tolerance_and_caps_of_its_own():
    caps = {"iterations": 3}
    assert options("pn-pcg", caps) == {}
    assert options("gast15", caps) == {"iterations": 3, "eps": 1e-3}


def test_every_range_of_the_text_is_recorded():
    printed = {t.removeprefix("hot.sec7_2.speedup.").rpartition(".")[0] for t in targets.load()
               if t.startswith("hot.sec7_2.speedup.")}
    assert {m.replace("-", "_") for m in ABLATION} == printed


def test_last_increments_are_carried_node_by_node():
    index, dv = np.array([[0, 1], [2, 3]]), np.array([[1.0, 2.0], [3.0, 4.0]])
    initial = carry_increments(index, dv, np.array([[2, 3], [5, 5], [0, 1]]))
    np.testing.assert_array_equal(initial, [[3.0, 4.0], [0.0, 0.0], [1.0, 2.0]])


def test_starts_of_a_step_are_admissible(cache):
    problem, state = states.warm_state("block", "quick")
    first, second = states.following_steps(problem, state, 2)
    q = second.pose.unknowns
    last = first.pose.unknowns.index, np.ones_like(first.pose.unknowns.v)
    begin = start_increments(second, last)
    np.testing.assert_array_equal(begin["zero"], q.dv0)
    np.testing.assert_allclose(begin["gravity"], [[0.0, -9.8 * second.dt]] * len(q.m), rtol=1e-14)
    assert set(np.unique(begin["last"])) <= {0.0, 1.0}
    assert begin["last"].any()


def test_one_more_row_has_a_flexible_method_of_the_printed_options():
    assert solver(FLEXIBLE) == replace(printed("pn-mgpcg"), flexible=True) != printed("pn-mgpcg")
    assert [solver(method) for method in METHODS if method != FLEXIBLE] == [
        method for method in METHODS if method != FLEXIBLE]
