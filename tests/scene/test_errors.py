import tomllib
from contextlib import suppress
from copy import deepcopy
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mpm_ref import sampling, shapes
from mpm_ref.sampling import poisson
from mpm_ref.scene import SceneError, build, loads
from mpm_ref.scene.builder import build_conditions
from mpm_ref.scene.validate import validate_scene
from mpm_ref.shapes.inside import solid

RICH = tomllib.loads((Path(__file__).parents[1] / "support/data" / "rich.toml").read_text())


def changed(path, value):
    """The rich scene with another value at a path like "body.0.name"; None takes the key away."""
    data = deepcopy(RICH)
    table, *steps = data, *(int(s) if s.isdigit() else s for s in path.split("."))
    for step in steps[:-1]:
        table = table[step]
    if value is None:
        del table[steps[-1]]
    else:
        table[steps[-1]] = value
    return data


WRONG = [
    # keys
    ("dims", 3, "dims: unknown key; did you mean `dim`?"),
    ("xyzzy", 3, "xyzzy: unknown key; the keys here are body, boundary,"),
    ("body.0.material.flow.fricton_angle", 3, "body[0].material.flow.fricton_angle: unknown key; "
     "did you mean `friction_angle`?"),
    ("body.0.shape.minus.0.centre", [0, 0, 0], "body[0].shape.minus[0].centre: unknown key; "
     "did you mean `center`?"),
    ("dx", None, "dx: this key is missing"),
    ("body.0.shape.minus.0.radius", None, "body[0].shape.minus[0].radius: this key is missing"),
    ("body.0.shape.type", None, "body[0].shape: the key `type` is missing; it is one of 'half_s"),
    ("steps", None, "steps: this key is missing; give `steps` or `end`"),
    ("body.0.density", None, "body[0]: a body with a shape needs `density`"),
    ("body.0.shape", None, "body[0]: a body needs `shape` or `particles`, one of the two"),
    # types and bounds
    ("dim", 4, "dim = 4: expected one of 2, 3"),
    ("dx", "0.1", "dx = '0.1': expected a number"),
    ("dx", True, "dx = True: expected a number"),
    ("dx", 0.0, "dx = 0.0: expected a number >= 1e-09"),
    ("dx", [0.1, 0.1, 0.1], "dx = [0.1, 0.1, 0.1]: expected a number"),
    ("steps", 2.5, "steps = 2.5: expected a whole number"),
    ("steps", 10**40, "steps = 1000000"),
    ("title", date(2020, 1, 1), "title = datetime.date(2020, 1, 1): expected text"),
    ("gravity.2", float("nan"), "gravity[2] = nan: expected a finite number"),
    ("body.0.density", float("inf"), "body[0].density = inf: expected a finite number"),
    ("body.0.density", -1.0, "body[0].density = -1.0: expected a number >= 1e-30"),
    ("body.0.name", "a/b", "body[0].name = 'a/b': expected text matching"),
    ("body", [], "body = []: expected a list of length >= 1"),
    ("body.0", 3, "body[0] = 3: expected a table"),
    ("body.0.shape.type", "bax", "body[0].shape.type = 'bax': expected one of 'half_space', 'box'"),
    ("collider.0.shape.type", "union", "collider[0].shape.type = 'union': expected one of 'half_"),
    ("collider.0.kind", "stuck", "collider[0].kind = 'stuck': expected one of"),
    ("walls.low.1", "opn", "walls.low[1] = 'opn': expected one of 'open', a whole number"),
    # what a table knows by itself
    ("body.0.material.nu", 0.6, "body[0].material.nu = 0.6: expected -1 < nu < 0.5"),
    ("body.0.material.law", "henky", "body[0].material: law 'henky': expected one of"),
    ("body.0.material.lam", 3.0, "body[0].material: law 'hencky': unknown parameter lam"),
    ("body.0.material.flow.type", "sandy", "body[0].material.flow: flow 'sandy': expected one"),
    ("body.0.material.flow.friction_angle", 95,
     "body[0].material.flow.friction_angle = 95.0: expected degrees"),
    ("body.0.sampling.radius", 0.1, "body[0].sampling: poisson needs `radius`, `count` or"),
    ("body.0.particles", {"file": "a.npz"}, "body[0]: a body needs `shape` or `particles`, one"),
    ("scheme.degree", 4, "scheme.degree = 4: expected 1, 2 or 3"),
    ("scheme.transfer", "flipp", "scheme.transfer = 'flipp': expected one of pic, flip"),
    # what does not fit together
    ("dim", 2, "body[0].shape.shape.lower = [0.5, 0.5, 0.5]: expected 2 numbers (dim = 2)"),
    ("gravity", [0, 1], "gravity = [0.0, 1.0]: expected 3 numbers (dim = 3)"),
    ("body.0.shape.minus.0.center", [0, 0],
     "body[0].shape.minus[0].center = [0.0, 0.0]: expected 3 numbers (dim = 3)"),
    ("cfl", 0.5, "dt: given together with `cfl`; give one of the two"),
    ("end", 0.5, "steps: given together with `end`; give one of the two"),
    ("interval", 0.5, "every: given together with `interval`; give one of the two"),
    ("body.1.name", "sand", "body[1].name = 'sand': another body has this name"),
    ("body.0.velocity.angular", 2.0, "body[0].velocity.angular = 2.0: expected 3 numbers"),
    ("clip.upper", [0, 1, 1], "clip: expected lower < upper on every axis"),
    ("limits.J", [2.0, 10.0], "limits.J = [2.0, 10.0]: expected two numbers, one < 1, one > 1"),
    ("walls.low", [3, 3], "walls.low = [3, 3]: expected 3 node indices"),
    ("walls.kind", "sticky", "walls.friction = 0.5 with kind 'sticky'"),
    ("collider.0.shape.edge", None, "collider[0].shape.edge = None in 3D"),
    ("collider.0.motion.axis", None, "collider[0].motion.angle = 45: expected an axis beside"),
    ("fixed.0.motion.axis", None, "fixed[0].motion.axis = None in 3D"),
    ("collider.0.motion.translation.rates.1", 3,
     "collider[0].motion.translation.rates[1] = 3.0: expected 3 numbers"),
    ("collider.0.motion.translation.times", [1, 0], "collider[0].motion.translation.times ="),
    ("fixed.0.motion.rotation.rate", [0, 0, 1], "fixed[0].motion.rotation.rate ="),
    ("fixed.0.region.minor", 3, "fixed[0].region.major = 1.0, minor = 3.0: expected"),
]


@pytest.mark.parametrize(("path", "value", "said"), WRONG, ids=[f"{w[0]}={w[1]}" for w in WRONG])
def test_the_sentence_names_the_key(path, value, said):
    with pytest.raises(SceneError) as caught:
        validate_scene(changed(path, value), "x.toml")
    assert str(caught.value).startswith(f"x.toml: {said}")
    assert "\n" not in str(caught.value)


BUILD = [
    ("body.0.shape.shape.upper", [1, 1, 0], "body[0].shape: box from"),
    ("body.0.shape", {"type": "half_space", "point": [0, 0, 0], "normal": [0, 0, 1]},
     "body[0].sampling: the shape has no end"),
    ("body.0.shape", {"type": "mesh", "file": "none.stl"}, "body[0].shape.file = 'none.stl'"),
    ("body.1.shape.axis", None, "body[1].shape.angle = 30: expected an axis"),
    ("body.1.sampling", {"type": "lattice", "counts": [2, 2]}, "body[1].sampling.counts = [2, 2]"),
    ("body.1.sampling", {"type": "poisson", "radius": 1e-6}, "body[1].sampling.radius = 1e-06"),
]


@pytest.mark.parametrize(("path", "value", "said"), BUILD, ids=[w[2] for w in BUILD])
def test_what_only_building_can_find_names_the_key(path, value, said):
    with pytest.raises(SceneError) as caught:
        build(validate_scene(changed(path, value)))
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize("text", [
    "dim = ", "dim = 2\ndim = 3", "{", "[[[", "a = " + 3000 * "[" + 3000 * "]", "\x00",
    "steps = " + 5000 * "9",
], ids=lambda text: text[:20])
def test_text_that_is_no_toml(text):
    with pytest.raises(SceneError, match=r"^x.toml: ") as caught:
        loads(text, "x.toml")
    assert "\n" not in str(caught.value)


def test_deeply_nested_tables():
    shape = RICH["body"][0]["shape"]
    for _ in range(3000):
        shape = {"type": "moved", "shape": shape}
    with pytest.raises(SceneError, match="nested too deeply"):
        validate_scene(changed("body.0.shape", shape))


# fuzz: whatever stands in a scene, the error is one sentence that begins with the file

JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.dates()
    | st.sampled_from([10**400, -1, 0, 1e300, 5e-324, "box", "sphere", "open", b"x", object()]),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(st.sampled_from(["type", "shape", "file", "x - at `$y", "a\nb"]), inner),
    max_leaves=5)


def paths(data, here=()):
    """Paths of all values in plain tables."""
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for step, value in items:
        yield (*here, step)
        if isinstance(value, dict | list):
            yield from paths(value, (*here, step))


def refused(data):
    """The sentence with which a scene is refused, or None."""
    said = None
    try:
        validate_scene(data, "x.toml")
    except SceneError as fault:
        said = str(fault)
    assert said is None or (said.startswith("x.toml: ") and "\n" not in said)
    return said


@settings(max_examples=400)
@given(path=st.sampled_from(sorted(paths(RICH), key=str)), value=JUNK)
def test_junk_anywhere(path, value):
    said = refused(changed(".".join(map(str, path)), value))
    keys = [step for step in path if isinstance(step, str)]
    # the sentence names a key on the way to what was changed
    assert said is None or any(key in said for key in keys)


@settings(max_examples=200)
@given(table=st.sampled_from(["", *(p for p in paths(RICH) if p[-1] in ("shape", "flow", 0))]),
       key=st.text(), value=JUNK)
def test_unknown_keys_anywhere(table, key, value):
    data = deepcopy(RICH)
    place = data
    for step in table:
        place = place[step]
    if isinstance(place, dict) and key not in place:
        place[key] = value
        assert refused(data) is not None


@settings(max_examples=200)
@given(JUNK | st.dictionaries(st.sampled_from(sorted(RICH)) | st.integers(), JUNK))
def test_junk_altogether(data):
    assert refused(data) is not None


NUMBER = st.floats(-1e9, 1e9) | st.sampled_from([0.0, 1.0, -1.0, 1e9, 1e-9])
SIZE = st.floats(1e-9, 1e9) | st.just(1.0)


def vectors(d):
    return st.tuples(*d * [NUMBER])


def some_shapes(d):
    """Shapes of any proportions, most of them absurd."""
    v, axis = vectors(d), vectors(d) if d == 3 else st.none()
    simple = st.one_of(
        st.builds(shapes.HalfSpace, point=v, normal=v),
        st.builds(shapes.Box, lower=v, upper=v),
        st.builds(shapes.Sphere, center=v, radius=SIZE),
        st.builds(shapes.Cylinder, start=v, end=v, radius=SIZE),
        st.builds(shapes.Capsule, start=v, end=v, radius=SIZE),
        st.builds(shapes.Torus, center=v, major=SIZE, minor=SIZE, axis=axis),
        st.builds(shapes.Wedge, tip=v, direction=v, half_angle=st.floats(1e-6, 89.999), length=SIZE,
                  edge=axis, width=SIZE if d == 3 else st.none()),
    )
    return simple | st.builds(shapes.Transformed, shape=simple, scale=SIZE,
                              angle=st.floats(-1e6, 1e6), axis=axis, about=v, translate=v)


@pytest.fixture
def few_points(monkeypatch):
    """Samplings that give up early, so that absurd shapes cost nothing."""
    monkeypatch.setattr(sampling, "MOST_POINTS", 1000)
    monkeypatch.setattr(poisson, "MAX_CELLS", 20_000)


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), dx=SIZE)
def test_absurd_shapes_are_sampled_or_refused(few_points, d, data, dx):
    shape = data.draw(some_shapes(d))
    record = data.draw(st.sampled_from([
        sampling.Regular(), sampling.Jittered(), sampling.Lattice(counts=d * (3,)),
        sampling.Lattice(spacing=1.0), sampling.Poisson(radius=1.0), sampling.Poisson(count=5)]))
    with suppress(ValueError):
        x, V0 = sampling.sample(record, solid(shape), dx, 0)
        assert np.isfinite(x).all()
        assert (V0 > 0.0).all()


def test_rich_scene_itself_is_right():
    scene = validate_scene(RICH)
    assert len(build_conditions(scene).parts) == 2


def test_an_angular_velocity_in_2d_is_a_number():
    tables = {"dim": 2, "dx": 0.1, "end": 1.0, "body": [{
        "name": "disk", "density": 1.0, "velocity": {"angular": [0.0, 0.0, 8.0]},
        "shape": {"type": "sphere", "center": [0.5, 0.5], "radius": 0.2},
        "material": {"law": "fixed_corotated", "E": 1.0, "nu": 0.3}}]}
    with pytest.raises(SceneError, match=r"angular = \[0.0, 0.0, 8.0\]: expected a number"):
        validate_scene(tables)
