"""The tables [[contact]]: which bodies touch, and how."""

import numpy as np
import pytest

from mpm_ref.body_contact import BodyContact, ContactStepper
from mpm_ref.explicit import Stepper
from mpm_ref.rom.study.full_model import ldm_full_model, nsf_full_model
from mpm_ref.scene import SceneError, build, canonical, dumps, loads
from mpm_ref.simulate import simulate
from mpm_ref.sweep.conditions import record_impulses

BODY = """
[[body]]
name = "{name}"
density = 1000.0
shape = {{ type = "box", lower = [{x}, 0.0], upper = [{end}, 0.4] }}
material = {{ law = "fixed_corotated", E = 1e4, nu = 0.3 }}
"""
SCENE = """
dim = 2
dx = 0.1
steps = 3
gravity = [0.0, -9.8]
""" + "".join(BODY.format(name=name, x=x, end=x + 0.4)
              for name, x in (("a", 0.0), ("b", 0.4), ("c", 0.8))) + """
[[collider]]
shape = { type = "half_space", point = [0.0, 0.0], normal = [0.0, 1.0] }
"""
CONTACT = """
[[contact]]
bodies = ["a", "b"]
friction = 0.3
"""


def test_a_table_is_a_contact_of_the_problem():
    problem = build(loads(SCENE + CONTACT))
    assert problem.contacts == (BodyContact(("a", "b"), 0.3),)
    assert type(problem.stepper()) is ContactStepper
    assert type(build(loads(SCENE)).stepper()) is Stepper


def test_bodies_touch_in_all_pairs():
    (contact,) = build(loads(SCENE + '[[contact]]\nbodies = ["a", "b", "c"]\n')).contacts
    assert set(contact.pairs) == {frozenset("ab"), frozenset("ac"), frozenset("bc")}
    assert (contact.friction, contact.kind) == (0.0, "separate")


def test_a_scene_is_written_and_read_back():
    scene = loads(SCENE + CONTACT)
    assert loads(dumps(scene)) == scene
    assert "[[contact]]" in dumps(scene)
    assert loads(canonical(scene)) == scene
    assert "contact" not in canonical(loads(SCENE))


@pytest.mark.parametrize(("table", "message"), [
    ('bodies = ["a"]', r"contact[0].bodies = ['a']: expected two bodies or more"),
    ('bodies = ["a", "a"]', "contact[0].bodies = ['a', 'a']: body 'a' stands there twice"),
    ('bodies = ["a", "d"]', "contact[0]: body 'd': there is none of this name; expected one of "
                            "'a', 'b', 'c'"),
    ('bodies = ["a", "b"]\n[[contact]]\nbodies = ["c", "b", "a"]',
     "contact[1]: bodies 'a' and 'b': two contacts name this pair; expected one"),
    ('bodies = ["a", "b"]\nkind = "slip"', "contact[0].kind = 'slip': expected one of "
                                           "'separate', 'stick'"),
    ('bodies = ["a", "b"]\nkind = "stick"\nfriction = 0.1', "only separate rubs"),
    ('friction = 0.1', "contact[0]"),
])
def test_wrong_tables_are_refused_in_one_sentence(table, message):
    with pytest.raises(SceneError) as caught:
        loads(f"{SCENE}\n[[contact]]\n{table}\n")
    assert message in str(caught.value)


@pytest.mark.parametrize(("head", "message"), [
    ('integrator = "hot"', "contact: expected none with an implicit integrator"),
    ('scheme = { degree = 1, transfer = "flip" }', "with degree = 1: expected 2 or 3"),
])
def test_steps_without_contact_refuse_it(head, message):
    with pytest.raises(SceneError, match=message):
        loads(head + SCENE + CONTACT)


def test_conditions_at_surfaces_act_on_each_field():
    """Bodies far from each other fall on a floor between nodes, each as if it were alone."""
    head = 'boundary = "surface"\n' + SCENE.replace("steps = 3", "steps = 40").replace(
        "point = [0.0, 0.0]", "point = [0.0, -0.02]")
    apart = head.replace("[0.4, 0.0]", "[2.4, 0.0]").replace("[0.8, 0.4]", "[2.8, 0.4]").replace(
        "[0.8, 0.0]", "[4.8, 0.0]").replace("[1.2000000000000002, 0.4]", "[5.2, 0.4]")
    *_, last = simulate(build(loads(apart + CONTACT)))
    assert [len(body.particles.x) for body in last.state.bodies] == [64, 64, 64]
    *_, one = simulate(build(loads(apart)))
    *_, falling = simulate(build(loads(apart[:apart.index("[[collider]]")] + CONTACT)))
    for body, same, free in zip(last.state.bodies, one.state.bodies, falling.state.bodies,
                                strict=True):
        v = same.particles.v
        assert body.particles.v == pytest.approx(v, abs=1e-9 * np.abs(v).max())
        assert np.abs(body.particles.v - free.particles.v).max() > 0.1


def test_impulses_of_parts_are_those_of_all_bodies():
    """A floor that carries all three; with one field or three its impulse is the same at first."""
    totals = []
    for contact in ("", '[[contact]]\nbodies = ["a", "b", "c"]\n'):
        scene = loads(SCENE.replace("steps = 3", "steps = 1\ndt = 1e-3") + contact)
        problem, recorder = record_impulses(build(scene), scene)
        for _ in simulate(problem):
            pass
        totals.append(np.array(list(recorder.impulses().values())))
    assert totals[0][0, 1] > 0.0
    assert totals[1] == pytest.approx(totals[0], rel=0.05)


def test_reduced_models_refuse_it():
    with pytest.raises(ValueError, match="has contact of bodies"):
        nsf_full_model(loads('scheme = { transfer = "apic" }' + SCENE + CONTACT))
    with pytest.raises(ValueError, match="contact of bodies: reduced runs know none"):
        ldm_full_model(loads('scheme = { transfer = "pic" }' + SCENE + CONTACT))
