"""Graph networks beside laws: which there are, what they are framed_run, free runs, tables."""

import gnn_toys as toys
import numpy as np
import pytest
from record_verdicts import expected, verdict

from mpm_ref.nclaw.gnn.features import MotionScales
from mpm_ref.nclaw.gnn.network import GraphWeights, PerceptronWeights
from mpm_ref.nclaw.gnn.simulator import Simulator
from mpm_ref.nclaw.gnn.weights import save
from mpm_ref.scene import build
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.common.weights_needed import Untrained
from validation.nclaw import curves, errors, simulators, tables, trained_laws
from validation.nclaw.environments import ENVIRONMENTS
from validation.nclaw.evaluate import (
    ComparedError,
    RunBroken,
    compare,
    copy_body,
    positions,
    rollout,
)
from validation.nclaw.simulators import GraphNet, framed_run, scenes_of
from validation.nclaw.tasks import SEEDS, reconstruction
from validation.nclaw.trained_laws import identity, trained

CENTER = (0.5, 0.5, 0.5)


def water(steps, **changes):
    return with_(reconstruction("water"), steps=steps, **changes)


def thrown(x):
    """Velocities of the training run at its start."""
    return np.array((1.0, -1.5, -2.0)) + np.cross((4.0, 4.0, 4.0), x - CENTER)


def still(dt=toys.DT, a=0.0):
    """A `Simulator` that answers zero: each frame adds an acceleration a [m]."""
    nothing = tuple((np.zeros((n, m)), np.zeros(m)) for n, m in ((21, 1), (1, 1), (1, 1)))
    edges = ((np.zeros((4, 1)), np.zeros(1)), *nothing[1:])
    last = (*nothing[1:], (np.zeros((1, 3)), np.zeros(3)))
    scales = MotionScales(np.zeros(3), np.ones(3), np.full(3, a), np.ones(3))
    network = GraphWeights(PerceptronWeights(nothing), PerceptronWeights(edges), (),
                           PerceptronWeights(last))
    return Simulator(network, toys.reading()._replace(dt=dt, scales=scales), {})


# which there are

def test_there_is_one_of_1_10_and_100_runs_for_each_environment():
    found = simulators.simulators()
    assert len(found) == 3 * len(ENVIRONMENTS)
    for name in ENVIRONMENTS:
        counts = {found[f"{name}-gnn{end}"].runs: found[f"{name}-gnn{end}"].environment
                  for end in ("", "-10", "-100")}
        assert counts == dict.fromkeys((1, 10, 100), name)
    assert found.items() <= trained_laws.nets().items()


def test_methods_are_told_by_their_names():
    found = {tables.method_of(name, net) for name, net in simulators.simulators().items()}
    assert found == {"gnn", "gnn-10", "gnn-100"}


def test_the_first_run_is_that_of_laws_and_none_is_of_task_b():
    first, *others = scenes_of(GraphNet("sand", runs=10))
    assert first == reconstruction("sand")
    velocities = [scene.body[0].velocity for scene in others]
    assert len({v.linear for v in velocities}) == 9
    assert not {v.linear for v in velocities} & {simulators.velocity("sand", seed).body[0]
                                             .velocity.linear for seed in SEEDS}
    assert scenes_of(GraphNet("sand", runs=3)) == [first, *others[:2]]


def test_a_training_is_known_by_all_that_its_net_says():
    net = GraphNet("water", 10)
    told = identity(net)
    assert told == {"scene": told["scene"], **net._asdict()}
    assert identity(GraphNet("water")) != told


# what is framed_run

def test_a_run_is_shown_in_frames_of_five_steps():
    seen = framed_run(water(20))
    problem = build(water(20))
    assert np.array_equal(seen.x, list(positions(problem, tuple(map(copy_body, problem.bodies)))))
    assert seen.x.shape == (5, 1000, 3)
    assert seen.dt == pytest.approx(2.5e-3)
    assert (*seen.box.low, *seen.box.high) == pytest.approx((0.1, 0.1, 0.1, 0.9, 0.9, 0.9))
    v = thrown(seen.x[0])
    assert seen.v == pytest.approx(v)
    assert seen.x[1] - seen.x[0] == pytest.approx(seen.dt * v, abs=3e-4)


# free runs

def test_a_free_run_begins_with_positions_and_velocities_of_the_scene():
    straight = list(rollout(build(water(15)), still()))
    assert len(straight) == 4
    for k, x in enumerate(straight):
        assert x == pytest.approx(straight[0] + k * 2.5e-3 * thrown(straight[0]), abs=1e-12)


def test_points_may_leave_the_box():
    """No clip holds them, unlike points of laws."""
    assert list(rollout(build(water(15)), still(a=1.0)))[-1].max() > 6.0


def test_errors_of_a_graph_network_are_measured_like_those_of_laws():
    seen = framed_run(water(15))
    straight = [seen.x[0] + k * seen.dt * seen.v for k in range(4)]
    exact, found = compare(water(15), [copy_body, still()])
    assert exact == ComparedError(0.0)
    assert found.error == pytest.approx(np.mean([(x - y) ** 2 for x, y in
                                                 zip(straight, seen.x, strict=True)]), rel=1e-9)
    assert found.error > 1e-9


def test_a_free_run_that_breaks_down_says_where():
    lost = still(a=np.inf)
    found, = compare(water(15), [lost])
    assert (found.error, found.step) == (np.inf, 5)
    assert "expected a finite place" in found.why
    with pytest.raises(RunBroken, match=r"^step 5: point 0 is at "):
        list(rollout(build(water(15)), lost))


@pytest.mark.parametrize(("scene", "dt", "said"), [
    (water(10, every=10), 2.5e-3, r"every = 10: frames 0\.005 s apart; the simulator has learned "
                                  r"0\.0025 s: set every = 5"),
    (water(10), 1e-3, r"every = 5: frames 0\.0025 s apart; .* 0\.001 s: set every = 2")])
def test_frames_that_are_not_those_it_learned_are_refused(scene, dt, said):
    with pytest.raises(ValueError, match=said):
        compare(scene, [still(dt)])


# weights

@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where weights are looked for; nothing is remembered of it."""
    monkeypatch.setattr(trained_laws, "FOLDER", tmp_path)
    trained.cache_clear()
    yield tmp_path
    trained.cache_clear()


def test_weights_of_graph_networks_are_found_by_name(folder):
    about = identity(trained_laws.nets()["jelly-gnn"])
    save(folder / "jelly-gnn.npz", toys.simulator()._replace(about=about))
    assert trained("jelly-gnn").about == about
    assert isinstance(trained("jelly-gnn"), Simulator)


def test_weights_that_are_not_there_or_of_another_training_are_told(folder):
    with pytest.raises(Untrained, match=r"^no weights sand-gnn-10\.npz: python -m "
                                             r"validation\.training\.nclaw sand-gnn-10$"):
        trained("sand-gnn-10")
    about = identity(trained_laws.nets()["sand-gnn"])
    save(folder / "sand-gnn-10.npz", toys.simulator()._replace(about=about))
    with pytest.raises(ValueError, match=r"are of .*'runs': 1, .*, now it is .*'runs': 10, .*: "):
        trained("sand-gnn-10")


# tables

@pytest.fixture
def trained_ones(monkeypatch):
    """All graph networks of one run have weights; errors are 1, 2, .. in their order."""
    count = iter(range(1, 99))

    def found(name):
        if not name.endswith("gnn"):
            raise Untrained(f"no weights {name}.npz")
        return still()._replace(about={"errors": [0.3, None, 0.1, 0.2], "picked": 2, "steps": 40})

    monkeypatch.setattr(tables, "trained", found)
    monkeypatch.setattr(tables, "RIVALS", {})
    monkeypatch.setattr(errors, "compare", lambda scene, laws, goes_on: [
        ComparedError(float(next(count))) for _ in laws])


def recorded(folder, experiment, profile="standard"):
    setting = RunSetting(profile, folder, targets=targets.load())
    assert run_all([experiment.experiment], setting) == []
    return {r.target: r for r in ProfileResults(folder).records(experiment.experiment.id)}


def test_table_1_has_their_row_and_says_what_was_smaller(tmp_path, trained_ones):
    found = recorded(tmp_path, tables.table1)
    one = found["nclaw.table1.gnn.sand.narrow"]
    assert (one.value, expected(one), verdict(one)) == (2.0, 0.011, "miss")
    assert one.note == simulators.simulators()["sand-gnn"].description
    assert one.note.startswith("a graph network 32 wide, trained on 1 run for 15000 steps with 1 "
                               "frame each; that of [GNS]: 128 wide, up to 20000000 steps")
    mean = found["nclaw.table1.gnn.overall_mean.narrow"]
    assert (mean.value, verdict(mean)) == (2.5, "miss")
    assert "water-gnn-10" in found["nclaw.table1.untrained"].note


def test_table_2_leaves_other_bodies_out_and_its_mean_is_partial(tmp_path, trained_ones):
    found = recorded(tmp_path, tables.table2)
    assert found["nclaw.table2.gnn.jello.time.narrow"].value == 1.0
    assert found["nclaw.table2.gnn.jello.velocity.narrow"].value == 3.0         # of 2, 3, 4
    assert not [target for target in found if "gnn" in target and "geometry" in target]
    mean = found["nclaw.table2.gnn.overall_mean.narrow.partial"]
    assert (mean.value, verdict(mean)) == (np.mean(range(1, 17)), "miss")
    assert "16 runs: time, velocity" in mean.scale


def test_what_was_picked_is_recorded(tmp_path, trained_ones):
    one = recorded(tmp_path, curves.loss)["nclaw.loss.gnn.jelly.picked"]
    assert (one.value, verdict(one), one.scale) == (0.1, "info", "40 steps, 4 checks")
    assert "at check 3; at the last one 0.2 m^2" in one.note


def test_table_6_is_of_1_10_and_100_runs_of_water(tmp_path, trained_ones, monkeypatch):
    monkeypatch.setattr(tables, "trained", lambda name: still()._replace(about={"of": name}))
    monkeypatch.setattr(errors, "compare", lambda scene, laws, goes_on: [
        ComparedError(2.0 * ("gnn" in one.about["of"]) + len(one.about["of"])) for one in laws])
    found = recorded(tmp_path, tables.table6)
    assert {target: one.value for target, one in found.items() if target != "nclaw.table6"} == {
        "nclaw.table6.gnn.10.loss.narrow": 2.0 + len("water-gnn-10"),
        "nclaw.table6.gnn.100.loss.narrow": 2.0 + len("water-gnn-100")}
    assert expected(found["nclaw.table6.gnn.10.loss.narrow"]) == 0.025
    assert "trained on 10 runs" in found["nclaw.table6.gnn.10.loss.narrow"].note
    table = (tmp_path / "nclaw.table6.errors.csv").read_text()
    assert [f"\n{method},water" in table for method in ("gnn.1", "gnn.10", "ours.1")] == [True] * 3


def test_table_6_tells_what_is_not_trained_and_runs_nothing(tmp_path, trained_ones, monkeypatch):
    def missing(name):
        raise Untrained(f"no weights {name}.npz")

    monkeypatch.setattr(tables, "trained", missing)
    monkeypatch.setattr(errors, "compare", lambda *args: pytest.fail("ran"))
    found = recorded(tmp_path, tables.table6)
    assert found.keys() <= {"nclaw.table6", "nclaw.table6.untrained"}
    assert found["nclaw.table6.untrained"].value == 4
