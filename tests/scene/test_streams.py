"""The tables [body.source] and [[sink]]: particles that enter and leave."""

import admissible_toys
import numpy as np
import pytest
from small_laws import saved
from stream_scenes import LENGTH, SPEED, gravity, problem, sink, stream

from mpm_ref.core.levelset import half_space
from mpm_ref.indicators import IndicatorWatch, conserves_energy
from mpm_ref.oracle.golden_file import require_recordable
from mpm_ref.preflight import misplaced
from mpm_ref.rom.study.full_model import ldm_full_model, nsf_full_model
from mpm_ref.scene import SceneError, build, canonical, dumps, loads
from mpm_ref.scene.streams import length_along
from mpm_ref.shapes import Box, Sphere
from mpm_ref.shapes.inside import solid
from mpm_ref.sweep.setting import in_seconds
from mpm_ref.trajectories import observed

REST = """
[[body]]
name = "rest"
density = 1000.0
shape = { type = "box", lower = [0.5, 0.1], upper = [0.6, 0.2] }
material = { law = "fixed_corotated", E = 1e4, nu = 0.3 }
"""
CONTACT = REST + '[[contact]]\nbodies = ["jet", "rest"]\n'


def test_tables_are_a_source_and_a_sink_of_the_problem():
    one = problem(2, "start = 0.0, stop = 0.2", more=REST + sink(height=0.3))
    (source,), (drain,) = one.sources, one.sinks
    assert (source.body, source.start, source.blocks) == (0, 0.0, 2)
    assert source.length == pytest.approx(LENGTH)
    assert source.period == pytest.approx(LENGTH / SPEED)
    assert drain.shape == half_space((0.0, 0.3), (0.0, 1.0))
    assert drain.holds(np.array([[0.0, 0.3], [0.0, 0.31], [5.0, -1.0]])).tolist() == \
        [True, False, True]
    assert [body.name for body in one.bodies] == ["jet", "rest"]
    assert len(one.bodies[0].id) == len(source.block.id) == 16
    assert not np.shares_memory(one.bodies[0].particles.x, source.block.particles.x)


def test_a_source_that_starts_later_has_no_particle_at_first():
    one = problem(2, "start = 0.1", more=REST)
    assert [len(body.id) for body in one.bodies] == [0, 16]
    assert not misplaced(one)
    floor = ('\n[[collider]]\nshape = { type = "half_space", point = [0.0, 0.95], normal = '
             '[0.0, 1.0] }\n')
    warned = misplaced(problem(2, "start = 0.1", more=REST + floor))
    assert sum("body 'jet' start inside" in sentence for sentence in warned) == 1


def test_a_scene_is_written_and_read_back():
    scene = loads(stream(2, "stop = 0.2", more=sink()))
    assert loads(dumps(scene)) == scene
    assert "[[sink]]" in dumps(scene)
    assert canonical(scene) != canonical(loads(stream(2, "stop = 0.3", more=sink())))
    assert canonical(scene) != canonical(loads(stream(2, "stop = 0.2")))


@pytest.mark.parametrize("d", [2, 3])
def test_a_sway_is_written_and_read_back(d):
    values = f"amplitude = {[0.1, 0.0, -0.3][:d]}, frequency = {[2.0, 0.0, 1.5][:d]}"
    scene = loads(stream(d, f"stop = 0.2, sway = {{ {values} }}"))
    assert loads(dumps(scene)) == scene
    assert canonical(scene) != canonical(loads(stream(d, "stop = 0.2")))
    (source,) = build(scene).sources
    assert source.sway.amplitude == scene.body[0].source.sway.amplitude == (0.1, 0.0, -0.3)[:d]
    assert source.sway.frequency == (2.0, 0.0, 1.5)[:d]


def test_the_length_of_a_shape_is_how_far_it_moves_until_it_has_left():
    box = solid(Box(lower=(0.0, 0.0), upper=(0.4, 0.1)))
    assert length_along(box, np.array([0.0, -3.0])) == pytest.approx(0.1)
    assert length_along(box, np.array([2.0, 0.0])) == pytest.approx(0.4)
    assert length_along(box, np.array([1.0, 1.0])) == pytest.approx(0.1 * np.sqrt(2.0))
    ball = solid(Sphere(center=(0.0, 0.0, 0.0), radius=0.2))
    assert length_along(ball, np.array([0.0, 0.0, 1.0])) == pytest.approx(0.4)


def test_the_number_of_blocks_follows_the_clock():
    assert problem(2, "").sources[0].blocks == 4
    assert problem(2, "", "dt = 1e-3\nsteps = 250").sources[0].blocks == 3
    assert problem(2, "stop = 0.2", "steps = 20").sources[0].blocks == 2
    assert problem(2, "length = 0.05").sources[0].blocks == 8


UNION = '{ type = "union", shapes = [{ type = "box", lower = [0.5, 0.9], upper = [0.6, 1.0] }] }'
PARTICLES = '{ file = "x.npz" }'


@pytest.mark.parametrize(("old", "new", "message"), [
    ("end = 0.35", "steps = 9", "body[0].source.stop: this key is missing"),
    ("source = {  }", "source = { start = 0.1 }", "no particle is there at t = 0"),
    ("source = {  }", "source = { start = -0.1 }", "start = -0.1: expected a number >= 0"),
    ("source = {  }", "source = { start = 0.2, stop = 0.1 }", "source.stop = 0.1: expected a time"),
    ("velocity = { linear = [0.0, -1.0] }", "", "needs `velocity.linear`"),
    ("linear = [0.0, -1.0]", "linear = [0.0, 0.0]", "needs `velocity.linear`"),
    ("linear = [0.0, -1.0]", "linear = [0.0, -1.0], angular = 1.0", "`velocity.angular` is for"),
    ('{ type = "box", lower = [0.5, 0.9], upper = [0.6, 1.0] }', UNION,
     "source.hold = true: expected an analytic shape"),
    ("\nshape = ", f"\nparticles = {PARTICLES}\n#", "`source` is for a body with a shape"),
    ("source = {  }", '[[sink]]\nname = "no shape"', "sink[0].shape: this key is missing"),
    ("source = {  }", "source = { length = 1e-9 }", "particles in all"),
    ("source = {  }", "source = { sway = { amplitude = [0.1, 0.0] } }",
     "source.sway.frequency: this key is missing"),
    ("source = {  }", "source = { sway = { frequency = [1.0, 1.0] } }",
     "source.sway.amplitude: this key is missing"),
    ("source = {  }", "source = { sway = { amplitude = [0.1, 0.0], frequency = [1.0, -1.0] } }",
     "source.sway.frequency[1] = -1.0: expected a number >= 0"),
    ("source = {  }", "source = { sway = { amplitude = [nan, 0.0], frequency = [1.0, 1.0] } }",
     "source.sway.amplitude[0] = nan: expected a finite number"),
    ("source = {  }", "source = { sway = { amplitude = [0.1, 0.0, 0.0], frequency = [1.0, 1.0] } }",
     "frequency = [1.0, 1.0]: expected 3 numbers, one for each of `amplitude`"),
    ("source = {  }", "source = { sway = { amplitude = [1, 0, 0], frequency = [1, 1, 1] } }",
     "source.sway.amplitude = [1.0, 0.0, 0.0]: expected 2 numbers (dim = 2)"),
    ("source = {  }", "source = { sway = { amplitude = [0.1, 0.2], frequency = [1.0, 0.0] } }",
     "expected a frequency > 0 wherever the amplitude is not 0"),
    ("source = {  }", "sway = { amplitude = [0.1, 0.2], frequency = [1.0, 1.0] }",
     "body[0].sway: unknown key"),
])
def test_what_makes_no_stream_is_refused(old, new, message):
    assert old in stream()
    with pytest.raises(SceneError) as fault:
        build(loads(stream().replace(old, new, 1)))
    assert message in str(fault.value)


@pytest.mark.parametrize(("source", "message"), [
    (True, "`source` with the law 'neural': expected a law by its name"),
    (False, "expected a law by its name with sources or sinks")])
def test_a_learned_law_refuses_streams(tmp_path, source, message):
    file = saved(tmp_path, admissible_toys.laws())
    law = f'{{ law = "neural", weights = "{file}" }}'
    text = stream(3, more="" if source else sink(3)).replace(
        '{ law = "fixed_corotated", E = 1e4, nu = 0.3 }', law)
    text = text if source else text.replace("source = {  }\n", "")
    assert law in text
    assert ("source" in text) == source
    with pytest.raises(SceneError) as fault:
        loads(text)
    assert message in str(fault.value)


def test_contact_refuses_streams():
    for text in (stream(more=CONTACT), stream(more=CONTACT).replace("source = {  }\n", sink())):
        with pytest.raises(SceneError, match="contact: expected none with sources or sinks"):
            loads(text)


@pytest.mark.parametrize("source", ["stop = 0.1", None])
def test_what_needs_the_same_particles_refuses_streams(source):
    """Golden files, reduced models, recorded trajectories, and comparisons of runs."""
    scheme = 'scheme = { transfer = "apic" }\ndt = 1e-3\nsteps = 9\nevery = 1'
    text = stream(2, source or "", scheme, "" if source else sink())
    if source is None:
        text = text.replace("source = {  }\n", "")
    scene = loads(text)
    one = build(scene)
    with pytest.raises(ValueError, match="sources or sinks: golden files"):
        require_recordable(one)
    with pytest.raises(ValueError, match="sources or sinks: reduced runs with inferred"):
        nsf_full_model(scene)
    with pytest.raises(ValueError, match="sources or sinks: reduced runs know none"):
        ldm_full_model(loads(text.replace("apic", "pic")))
    with pytest.raises(ValueError, match="sources or sinks: expected a body"):
        observed(one)
    with pytest.raises(SceneError, match="sources or sinks: runs are compared"):
        in_seconds(scene)


def test_indicators_watch_bodies_whose_particles_stay():
    one = problem(2, "hold = false", more=REST)
    assert set(IndicatorWatch(one)._rest) == {"rest"}
    assert not conserves_energy(one)
    assert not IndicatorWatch(problem(2, "", more=REST + sink()))._rest


def test_a_source_holds_its_nodes_as_a_fixed_region_does():
    fixed = """
[[fixed]]
region = { type = "box", lower = [0.5, 0.9], upper = [0.6, 1.0] }
follows = false
until = 0.2
motion = { translation = { type = "steady", rate = [0.0, -1.0] } }
"""
    held = problem(2, "stop = 0.2", "end = 0.3\n" + gravity()).conditions
    by_hand = problem(2, "stop = 0.2, hold = false", "end = 0.3\n" + gravity(), fixed).conditions
    (a,), (b,) = held.prescribed, by_hand.prescribed
    assert (a.shape, a.follows, a.since, a.until) == (b.shape, b.follows, b.since,
                                                      pytest.approx(b.until))
    assert a.motion.pose(0.2, 0.1, 2).v == pytest.approx(b.motion.pose(0.2, 0.1, 2).v)
