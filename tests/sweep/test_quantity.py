import numpy as np
import pytest
from sweep_scenes import BOUNCE, observed_run, scene_of

from mpm_ref.energy import energy
from mpm_ref.scene import build
from mpm_ref.sweep.observation import REFUSED, observe
from mpm_ref.sweep.quantity import (
    OutputQuantity,
    Snapshot,
    check_quantities,
    with_companions,
)

SCENE = scene_of(BOUNCE)


@pytest.fixture
def snapshot():
    problem = build(SCENE)
    x = problem.bodies[0].particles.x
    probes = {"block": x[:7]}
    return Snapshot(problem, problem.bodies, probes, probes, {"floor": np.array([1.0, 2.0])})


def value(text, snapshot):
    check_quantities((text,), SCENE)
    return OutputQuantity(text).sample(snapshot)


def test_shapes_and_values(snapshot):
    problem, x = snapshot.problem, snapshot.bodies[0].particles.x
    now = energy(snapshot.bodies, problem.gravity, problem.inertia)
    assert value("positions", snapshot) == pytest.approx(x[:7].ravel())
    assert value("centroid", snapshot) == pytest.approx([0.4, 0.5])
    assert value("path:0.225,0.4", snapshot).shape == (2,)
    assert value("kinetic", snapshot) == pytest.approx([now.kinetic])
    assert value("energy", snapshot) == pytest.approx([now.sum])
    assert value("impulse:floor", snapshot) == pytest.approx([1.0, 2.0])


def test_fronts_are_the_faces_of_a_box(snapshot):
    faces = [value(f"front:{side}", snapshot)[0] for side in ("x-", "x+", "y-", "y+")]
    assert faces == pytest.approx([0.2, 0.6, 0.3, 0.7])


def test_profile_of_a_box_is_uniform(snapshot):
    from mpm_ref.sweep.quantity import QUANTILES
    assert value("profile:x", snapshot) == pytest.approx(0.2 + 0.4 * QUANTILES)


def test_means_in_a_box(snapshot):
    assert value("mean:J:0,0,1,1", snapshot) == pytest.approx([1.0])
    assert value("mean:speed:0,0,1,1", snapshot) == pytest.approx([np.hypot(0.5, 1.0)])
    assert np.isnan(value("mean:J:5,5,6,6", snapshot)).all()


def test_pressure_is_minus_the_mean_stress(snapshot):
    q = snapshot.bodies[0].particles
    q.tau[:] = -7.0 * np.eye(2)
    assert value("mean:pressure:0,0,1,1", snapshot) == pytest.approx([7.0])
    q.F[:] = 2.0 * np.eye(2)            # tau = J sigma, and J = 4
    assert value("mean:J:0,0,1,1", snapshot) == pytest.approx([4.0])
    assert value("mean:pressure:0,0,1,1", snapshot) == pytest.approx([7.0 / 4.0])


def test_the_centroid_is_that_of_the_mass(snapshot):
    q = snapshot.bodies[0].particles
    q.m[:] = 0.0
    q.m[3], q.m[-1] = 1.0, 3.0
    assert value("centroid", snapshot) == pytest.approx(0.25 * q.x[3] + 0.75 * q.x[-1])


def test_a_path_starts_in_a_body(snapshot):
    with pytest.raises(ValueError, match=r"'path:9,9': the point lies outside of the box of all "
                                         r"bodies at the start, from .*; expected a point of"):
        value("path:9,9", snapshot)


def test_a_path_is_that_of_the_nearest_probe(snapshot):
    X = snapshot.starts["block"]
    moved = snapshot._replace(probes={"block": X + [[10.0 * k, 0.0] for k in range(len(X))]})
    for k in (0, 3, 6):
        x, y = X[k] + 1e-3
        assert value(f"path:{x},{y}", moved) == pytest.approx(X[k] + [10.0 * k, 0.0])


@pytest.mark.parametrize(("text", "near"), [
    ("postions", "positions"), ("frnt:x+", "front"), ("inpulse:floor", "impulse"),
    ("kinetics@end", "kinetic")])
def test_the_nearest_quantity_is_offered(text, near):
    with pytest.raises(ValueError, match=rf"^quantity '.*': did you mean {near}[?] expected pos"):
        OutputQuantity(text)


def test_a_quantity_that_resembles_none_has_no_near_one():
    with pytest.raises(ValueError, match=r"^quantity 'beauty': expected positions, centroid,"):
        OutputQuantity("beauty")


def test_companions_are_energies_and_profiles_each_once():
    assert with_companions(("elastic", "front:x+"), 2) == (
        "elastic", "front:x+", "kinetic", "profile:x", "profile:y")
    assert with_companions(("positions",), 3)[-1] == "profile:z"


@pytest.mark.parametrize("text", [
    "", "speed", "positions@middle", "front:x", "front:q+", "profile:z", "path:1", "path:a,b",
    "region:5,5,6,6", "impulse:ceiling", "mean:T:0,0,1,1", "mean:J:0,0", "positions:sphere",
    "path:nan,0.3", "mean:J:0,0,inf,1", "kinetic:block:block", "centroid:a:b:c"])
def test_bad_texts_get_one_sentence(snapshot, text):
    with pytest.raises(ValueError, match="expected") as error:
        value(text, snapshot)
    assert "\n" not in str(error.value)


def test_impulse_of_the_floor_is_the_change_of_momentum():
    scene = scene_of(BOUNCE)
    run = observe(observed_run(scene, ("impulse:floor", "centroid"), n=3))
    problem = build(scene)
    m = problem.bodies[0].particles.m.sum()
    from mpm_ref.energy import momentum
    from mpm_ref.simulate import simulate
    start = momentum(problem.bodies).copy()
    for _ in simulate(problem):
        pass
    change = momentum(problem.bodies) - start - m * np.array([0.0, -9.8]) * 0.3
    assert change[1] > 100.0
    assert run.values["impulse:floor"][-1] == pytest.approx(change, rel=1e-9, abs=1e-9)


RESTING = """
dim = 2
dx = 0.1
end = 1.0
gravity = [0.0, -9.8]
scheme = { transfer = "pic" }
[[body]]
name = "block"
density = 1000.0
shape = { type = "box", lower = [0.2, 0.1], upper = [0.6, 0.5] }
material = { law = "fixed_corotated", E = 1e6, nu = 0.3 }
[[collider]]
name = "floor"
kind = "separate"
shape = { type = "half_space", point = [0.0, 0.1], normal = [0.0, 1.0] }
"""     # PIC damps the oscillation under its own weight


def test_force_of_the_floor_on_a_block_at_rest_is_its_weight():
    scene = scene_of(RESTING)
    run = observe(observed_run(scene, ("force:floor", "impulse:floor"), n=6))
    weight = 1000.0 * 0.4 * 0.4 * 9.8
    assert run.finished
    assert run.values["force:floor"][0] == pytest.approx([0.0, 0.0])
    assert run.values["force:floor"][-1] == pytest.approx(
        [0.0, weight], rel=1e-3, abs=1e-3 * weight)
    assert run.values["impulse:floor"][-1] == pytest.approx(
        0.2 * run.values["force:floor"].sum(axis=0), rel=1e-12)


def test_a_force_is_the_mean_between_two_times():
    force, impulse = OutputQuantity("force:floor"), OutputQuantity("impulse:floor")
    J, t = np.array([[0.0, 0.0], [1.0, 2.0], [1.0, 6.0], [np.nan, np.nan]]), (0.0, 0.5, 1.5, 2.0)
    assert force.series(J, t)[:3].tolist() == [[0.0, 0.0], [2.0, 4.0], [0.0, 4.0]]
    assert np.isnan(force.series(J, t)[3]).all()
    assert impulse.series(J, t) is J
    assert force.series(np.empty((4, 0)), t).shape == (4, 0)


@pytest.mark.parametrize("text", ["impulse:floor", "force:floor"])
def test_a_run_of_a_scene_without_the_part_is_refused(text):
    scene = scene_of(BOUNCE, collider=())
    run = observe(observed_run(scene, (text,)))
    assert run.outcome == REFUSED
    assert run.message.startswith(f"quantity '{text}': part = 'floor': expected a quantity without")
