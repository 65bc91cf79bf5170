"""A scene that is uniform along an axis moves as its section in 2D does, whichever the axis."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from needs_toys import runs_of, variant_of

from mpm_ref.needs.answer import lean_text
from mpm_ref.needs.plane import AXES, NotUniform, left_axes, prism
from mpm_ref.needs.removal import RemovalStudy
from mpm_ref.needs.variant import changes
from mpm_ref.scene import SceneError, loads
from mpm_ref.scene.quantity_records import quantity_of
from mpm_ref.shapes import Shape

LENGTH = 0.15
EXACT = "kinetic", "impulse:paddle", "centroid"
FITTED = "positions:block", "positions:roll"    # to other neighbours of a probe: h^2 apart
SOLID = """
dim = 3
dx = 0.05
dt = 0.0005
end = 0.02
gravity = {gravity}

[[body]]
name = "roll"
density = 1000.0
shape = {{ type = "cylinder", start = {start}, end = {end}, radius = 0.1 }}
velocity = {{ linear = {linear}, angular = {angular}, center = {center} }}
material = {{ law = "fixed_corotated", E = 1e4, nu = 0.0 }}

[[body]]
name = "block"
density = 500.0
shape = {{ type = "box", lower = {lower}, upper = {upper} }}
material = {{ law = "fixed_corotated", E = 1e4, nu = 0.0 }}

[[collider]]
name = "paddle"
kind = "slip"
shape = {{ type = "box", lower = {paddle_lower}, upper = {paddle_upper} }}
motion = {{ rotation = {{ type = "steady", rate = 3.0 }}, axis = {turn}, center = {center} }}
"""
PLATE = """
[[collider]]
name = "plate"
kind = "slip"
shape = {{ type = "half_space", point = {low}, normal = {normal} }}
"""


def embedded(axis, section, along):
    """A vector (3,) with two components of a section and one along an axis, as text."""
    vector = list(section)
    vector.insert(axis, along)
    return str([float(value) for value in vector])


def solid(axis, plate=False):
    """A scene that is uniform along an axis, with bodies of LENGTH."""
    text = SOLID + (PLATE if plate else "")
    sense = -1.0 if axis == 1 else 1.0      # x turns to z by a negative turn about y
    return text.format(
        gravity=embedded(axis, (0.0, -9.8), 0.0),
        start=embedded(axis, (0.4, 0.4), 0.1), end=embedded(axis, (0.4, 0.4), 0.1 + LENGTH),
        linear=embedded(axis, (0.5, 0.2), 0.0), angular=embedded(axis, (0.0, 0.0), 4.0 * sense),
        center=embedded(axis, (0.4, 0.4), 0.0), turn=embedded(axis, (0.0, 0.0), sense),
        lower=embedded(axis, (0.1, 0.3), 0.1), upper=embedded(axis, (0.25, 0.45), 0.1 + LENGTH),
        paddle_lower=embedded(axis, (0.45, 0.45), 0.0),
        paddle_upper=embedded(axis, (0.7, 0.5), 1.0),
        low=embedded(axis, (0.0, 0.0), 0.1), normal=embedded(axis, (0.0, 0.0), 1.0))


def section_of(text, axis):
    """The variant of a scene, and that of its section at right angles to an axis."""
    first = variant_of(text)
    label, = (one for one in first.offers if one.startswith(f"third dimension {AXES[axis]}"))
    return first, first.without(first.offers[label])


@pytest.mark.parametrize("axis", range(3))
def test_section_is_the_same_for_each_axis(axis):
    _, section = section_of(solid(axis), axis)
    _, other = section_of(solid(2), 2)
    assert section.scene == other.scene
    assert section.axes == left_axes(axis)
    assert section.length == pytest.approx(LENGTH)
    assert section.scene.dim == 2


@pytest.mark.slow
@pytest.mark.parametrize("axis", range(3))
def test_section_moves_as_the_solid(axis):
    """Without lateral stress (nu = 0) the two differ by round-off, energies and impulses too."""
    first, section = section_of(solid(axis), axis)
    study = RemovalStudy(runs_of(first, quantities=EXACT + FITTED), first, 0.01)
    runs = study.observe({"solid": first, "section": section})
    assert abs(runs["solid"].values["impulse:paddle"]).max() > 1e-3
    change = changes(runs["solid"], runs["section"], section, first)
    assert max(change[text][-1] for text in EXACT) < 1e-12
    assert max(change[text][-1] for text in FITTED) < 1e-2


def test_plates_at_the_ends_go():
    first, section = section_of(solid(0, plate=True), 0)
    assert [part.name for part in first.scene.collider] == ["paddle", "plate"]
    assert [part.name for part in section.scene.collider] == ["paddle"]


WALLED = """
dim = 3
dx = 0.05
dt = 0.001
end = 0.02
walls = { low = [2, 2, 2], high = [18, 18, 18] }

[[body]]
name = "block"
density = 1000.0
shape = { type = "box", lower = [0.3, 0.2, 0.1], upper = [0.7, 0.8, 0.9] }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }
"""


def offered(variant, begin):
    """The removal of a variant whose label begins so."""
    label, = (one for one in variant.offers if one.startswith(begin))
    return variant.offers[label]


@pytest.mark.parametrize("order", [("third dimension x", "half z"),
                                   ("half z", "third dimension x")])
def test_halves_and_sections_have_names_of_the_axes_at_first(order):
    first = variant_of(WALLED)
    variant = first.without(offered(first, order[0]))
    variant = variant.without(offered(variant, order[1]))
    half, = variant.halves
    assert half.axis == 2
    assert {"block", "wall y-", "wall y+"} <= set(half.halved)
    assert not {"wall z-", "wall z+"} & set(half.halved)
    assert [part.name for part in variant.scene.collider] == ["mirror z"]
    assert variant.quantity("force:wall z+") == "force:wall y+"
    assert variant.length == pytest.approx(0.4)


@pytest.mark.parametrize(("removals", "factor"), [
    ((), None), (("half z",), None), (("third dimension x",), 0.4),
    (("half z", "third dimension x"), 0.8)])
def test_the_lean_scene_says_the_factor_of_the_section(removals, factor):
    first = variant_of(WALLED)
    lean = first
    for begin in removals:
        lean = lean.without(offered(lean, begin))
    result = SimpleNamespace(first=first, lean=lean, cpu=1.0, order=())
    answer = SimpleNamespace(name="walled", error=0.01, command="mpm-ref needs", result=result)
    text = lean_text(answer, ".")
    assert ("those of the scene in 3D" in text) == (factor is not None)
    assert factor is None or f"times {factor:g} m are" in text


@pytest.mark.parametrize(("begin", "fault"), [
    ("third dimension x", "along the axis that is removed"), ("half x", "of the half")])
def test_the_lean_scene_names_a_quantity_that_went(begin, fault):
    first = variant_of(WALLED)
    lean = first.without(offered(first, begin))
    result = SimpleNamespace(first=first, lean=lean, cpu=1.0, order=())
    answer = SimpleNamespace(name="walled", error=0.01, command="mpm-ref needs", result=result)
    text = lean_text(answer, ".", (quantity_of("front:x-"), quantity_of("front:z+")))
    assert "No [[quantity]] front:x-: " in text
    assert fault in text
    kept = lean.quantity("front:z+")
    assert [one.text for one in loads(text).quantity] == [kept]


def test_half_of_each_axis_has_a_wall_of_its_own():
    variant = variant_of(WALLED)
    for begin in ("half y", "third dimension x", "half z"):
        variant = variant.without(offered(variant, begin))
    assert [part.name for part in variant.scene.collider] == ["mirror y", "mirror z"]
    assert variant.scene.body[0].shape.lower == (0.5, 0.5)


@pytest.mark.parametrize(("point", "normal", "inside", "uniform"), [
    (0.1, 1.0, False, True), (0.05, 1.0, False, True), (0.2, 1.0, False, False),
    (0.25, -1.0, False, True), (0.2, -1.0, False, False), (0.3, 1.0, True, True),
    (0.25, 1.0, True, True), (0.2, 1.0, True, False), (0.0, -1.0, True, True)])
def test_plate_that_reaches_into_the_bodies(point, normal, inside, uniform):
    text = solid(2) + f"""
[[collider]]
inside = {str(inside).lower()}
shape = {{ type = "half_space", point = [0.0, 0.0, {point}], normal = [0.0, 0.0, {normal}] }}
"""
    offers = variant_of(text).offers
    assert any(one.startswith("third dimension z") for one in offers) == uniform


def test_half_cylinder_has_a_section():
    half = {"type": "intersection", "shapes": [
        {"type": "cylinder", "start": [0, 0, 0], "end": [0, 2, 0], "radius": 1},
        {"type": "half_space", "point": [0, 1, 0], "normal": [0, -1, 0]}]}
    made = prism(msgspec.convert(half, Shape), 1)
    assert made.tables == {"type": "sphere", "center": [0, 0], "radius": 1}
    assert made.ends == (1, 2)


def test_quantities_of_the_section():
    _, section = section_of(solid(1), 1)
    texts = {"front:z+:roll@end": "front:y+:roll@end", "profile:x": "profile:x",
             "path:1,2,3": "path:1,3", "mean:J:0,1,2,3,4,5": "mean:J:0,2,3,5",
             "impulse:paddle": "impulse:paddle", "kinetic": "kinetic",
             "force:wall z-": "force:wall y-", "force:wall x+": "force:wall x+"}
    assert {text: section.quantity(text) for text in texts} == texts
    for text in ("front:y+", "profile:y", "impulse:wall y+"):
        with pytest.raises(SceneError, match="along the axis that is removed"):
            section.quantity(text)


@pytest.mark.parametrize(("old", "new"), [
    ('end = [0.4, 0.4, 0.25]', 'end = [0.4, 0.4, 0.35]'),        # ends differ
    ('end = [0.4, 0.4, 0.25]', 'end = [0.4, 0.45, 0.25]'),        # oblique
    ('gravity = [0.0, -9.8, 0.0]', 'gravity = [0.0, -9.8, 0.1]'),
    ('linear = [0.5, 0.2, 0.0]', 'linear = [0.5, 0.2, 0.1]'),
    ('angular = [0.0, 0.0, 4.0]', 'angular = [0.0, 1.0, 4.0]'),
    ('axis = [0.0, 0.0, 1.0]', 'axis = [0.0, 0.1, 1.0]'),
    ('upper = [0.7, 0.5, 1.0]', 'upper = [0.7, 0.5, 0.2]'),     # a collider of half the length
])
def test_scene_that_is_not_uniform(old, new):
    text = solid(2)
    assert old in text
    offers = variant_of(text.replace(old, new)).offers
    assert not any(label.startswith("third dimension z") for label in offers)


def test_scenes_in_2d_have_no_third_dimension():
    _, section = section_of(solid(2), 2)
    assert not any(label.startswith("third") for label in section.offers)


@pytest.mark.parametrize(("shape", "tables", "ends"), [
    ({"type": "half_space", "point": [1, 2, 3], "normal": [1, 0, 1]},
     {"type": "half_space", "point": [1, 3], "normal": [1, 1]}, (-np.inf, np.inf)),
    ({"type": "wedge", "tip": [1, 2, 3], "direction": [0, 0, 1], "half_angle": 10, "length": 2,
      "edge": [0, 1, 0]},
     {"type": "wedge", "tip": [1, 3], "direction": [0, 1], "half_angle": 10, "length": 2},
     (-np.inf, np.inf)),
    ({"type": "difference", "shape": {"type": "box", "lower": [0, 0, 0], "upper": [1, 1, 1]},
      "minus": [{"type": "cylinder", "start": [0, 2, 0], "end": [0, -1, 0], "radius": 0.5}]},
     {"type": "difference", "shape": {"type": "box", "lower": [0, 0], "upper": [1, 1]},
      "minus": [{"type": "sphere", "center": [0, 0], "radius": 0.5}]}, (0, 1)),
    ({"type": "intersection", "shapes": [
        {"type": "box", "lower": [0, 0, 0], "upper": [1, 1, 1]},
        {"type": "half_space", "point": [0.5, 0, 0.5], "normal": [1, 0, 1]}]},
     {"type": "intersection", "shapes": [
         {"type": "box", "lower": [0, 0], "upper": [1, 1]},
         {"type": "half_space", "point": [0.5, 0.5], "normal": [1, 1]}]}, (0, 1)),
])
def test_prisms_along_y(shape, tables, ends):
    made = prism(msgspec.convert(shape, Shape), 1)
    assert made.tables == tables
    assert made.ends == ends


@pytest.mark.parametrize("shape", [
    {"type": "sphere", "center": [0, 0, 0], "radius": 1},
    {"type": "capsule", "start": [0, 0, 0], "end": [0, 1, 0], "radius": 1},
    {"type": "half_space", "point": [0, 0, 0], "normal": [0, 1, 1]},
    {"type": "difference", "shape": {"type": "box", "lower": [0, 0, 0], "upper": [1, 1, 1]},
     "minus": [{"type": "box", "lower": [0, 0, 0], "upper": [0.5, 0.5, 0.5]}]},
    {"type": "union", "shapes": [{"type": "box", "lower": [0, 0, 0], "upper": [1, 1, 1]},
                                 {"type": "half_space", "point": [0, 0, 0], "normal": [0, 1, 0]}]},
    {"type": "intersection", "shapes": [
        {"type": "half_space", "point": [0, 0, 0], "normal": [0, 1, 0]}]},
])
def test_shapes_that_are_no_prisms(shape):
    with pytest.raises(NotUniform):
        prism(msgspec.convert(shape, Shape), 1)


def test_lattice_counts_of_the_section():
    text = solid(1).replace(
        'material = { law = "fixed_corotated", E = 1e4, nu = 0.0 }',
        'sampling = { type = "lattice", counts = [3, 4, 5] }\n'
        'material = { law = "fixed_corotated", E = 1e4, nu = 0.0 }')
    _, section = section_of(text, 1)
    assert section.scene.body[0].sampling.counts == (3, 5)
