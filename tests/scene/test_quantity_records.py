"""Tables of quantities of interest: what they mean, and what is refused."""

import pytest
from sweep_scenes import BOUNCE

from mpm_ref.scene import SceneError, build, digest, dumps, loads
from mpm_ref.scene.quantity_records import KINDS, quantity_of
from mpm_ref.scene.validate import validate_scene
from mpm_ref.sweep.quantity import OutputQuantity

TABLES = {
    "positions": 'type = "positions"',
    "positions:block@end": 'type = "positions"\nbody = "block"\nat_end = true',
    "centroid:block": 'type = "centroid"\nbody = "block"',
    "path:0.3,0.45": 'type = "path"\npoint = [0.3, 0.45]',
    "region:0.2,0.3,0.4,1": 'type = "region"\nlower = [0.2, 0.3]\nupper = [0.4, 1]',
    "front:y-": 'type = "front"\nside = "y-"',
    "front:x+:block@end": 'type = "front"\nside = "x+"\nbody = "block"\nat_end = true',
    "profile:y:block": 'type = "profile"\naxis = "y"\nbody = "block"',
    "kinetic": 'type = "kinetic"', "elastic@end": 'type = "elastic"\nat_end = true',
    "gravity": 'type = "gravity"', "energy": 'type = "energy"',
    "impulse:floor": 'type = "impulse"\npart = "floor"',
    "force:floor": 'type = "force"\npart = "floor"',
    "mean:J:0,0,1,1e-07": 'type = "mean"\nfield = "J"\nlower = [0, 0]\nupper = [1, 1e-7]',
}
THIRD = "0.3333333333333333"        # which %g does not write exactly


def scene_with(*tables):
    return loads(BOUNCE + "".join(f"\n[[quantity]]\n{table}\n" for table in tables))


@pytest.mark.parametrize("text", TABLES)
def test_a_table_and_a_text_are_the_same_quantity(text):
    record, = scene_with(TABLES[text]).quantity
    assert record.text == text
    assert OutputQuantity(text).record == record
    assert OutputQuantity(record.text) == OutputQuantity(text)


def test_every_kind_has_a_table_here():
    assert {table.split('"')[1] for table in TABLES.values()} == set(KINDS)


@pytest.mark.parametrize("text", [f"path:{THIRD},-1e-09", f"mean:speed:0,0,0,{THIRD},1,2e+08"])
def test_numbers_of_texts_are_exact(text):
    record = quantity_of(text)
    assert record.text == text
    assert float(THIRD) in (getattr(record, "point", None) or record.upper + record.lower)


@pytest.mark.parametrize(("text", "same"), [
    ("front: x+ : block", "front:x+:block"), ("positions:", "positions"),
    ("impulse:left: lower", "impulse:left: lower"),
    ("mean:J: 0, 0,1 ,1@ end", "mean:J:0,0,1,1@end")])
def test_spaces_and_colons(text, same):
    assert quantity_of(text).text == same


def test_tables_survive_in_a_file_and_change_no_run():
    scene, plain = scene_with(*TABLES.values()), loads(BOUNCE)
    assert loads(dumps(scene)) == scene
    assert dumps(scene).count("[[quantity]]") == len(TABLES)
    assert digest(scene) == digest(plain)
    assert build(scene).source == build(plain).source


@pytest.mark.parametrize(("table", "words"), [
    ('type = "front"\nside = "x"', r"quantity\[0\].side = 'x': expected one of 'x-', 'x\+'"),
    ('type = "front"\nside = "z+"', r"side = 'z\+': expected one of the axes x, y \(dim = 2\)"),
    ('type = "profile"\naxis = "z"', r"axis = 'z': expected one of the axes x, y"),
    ('type = "front"', r"quantity\[0\].side: this key is missing"),
    ('type = "frnt"', "type = 'frnt': expected one of 'positions', 'centroid'"),
    ('side = "x+"', r"quantity\[0\]: the key `type` is missing; it is one of 'positions'"),
    ('type = "mean"\nfield = "T"\nlower = [0, 0]\nupper = [1, 1]',
     "field = 'T': expected one of 'J', 'speed', 'pressure'"),
    ('type = "mean"\nfield = "J"\nlower = [0, 0, 0]\nupper = [1, 1, 1]',
     r"quantity\[0\].lower = \[0.0, 0.0, 0.0\]: expected 2 numbers"),
    ('type = "region"\nlower = [0, 2]\nupper = [1, 1]',
     r"quantity\[0\].lower = \[0.0, 2.0\]: expected at most `upper` = \[1.0, 1.0\]"),
    ('type = "path"\npoint = [0.1, nan]', r"point\[1\] = nan: expected a finite number"),
    ('type = "impulse"\npart = "flor"', "part = 'flor': did you mean 'floor'"),
    ('type = "force"\npart = "wall x-"', "part = 'wall x-': expected one of floor"),
    ('type = "centroid"\nbody = "blok"', "body = 'blok': did you mean 'block'"),
    ('type = "kinetic"\nbody = "block"', r"quantity\[0\].body: unknown key"),
    ('type = "front"\nsde = "x+"', "sde: unknown key; did you mean `side`"),
    ('type = "kinetic"\nat_end = 1', "at_end = 1: expected true or false")])
def test_what_does_not_fit_is_one_sentence(table, words):
    with pytest.raises(SceneError, match=words) as error:
        scene_with(table)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["a@b", " floor", "b ", "x@end"])
def test_a_part_that_no_text_can_name_is_refused(name):
    text = BOUNCE.replace('"floor"', f'"{name}"')
    with pytest.raises(SceneError, match=r"quantity\[0\].* expected a name without @"):
        loads(f'{text}\n[[quantity]]\ntype = "impulse"\npart = "{name}"\n')


def test_parts_without_a_name_have_their_place():
    text = BOUNCE.replace('name = "floor"\n', "")
    scene = loads(text + '\n[walls]\nlow = [0, "open"]\n[[quantity]]\ntype = "force"\n'
                  'part = "collider0"\n[[quantity]]\ntype = "impulse"\npart = "wall x-"\n')
    assert [one.text for one in scene.quantity] == ["force:collider0", "impulse:wall x-"]


def test_implicit_steps_state_no_impulse():
    text = 'integrator = "hot-plus"\n' + BOUNCE + '\n[[quantity]]\ntype = "impulse"\npart = "floor"'
    with pytest.raises(SceneError, match="part = 'floor': implicit steps state no impulses"):
        loads(text)


def test_a_scene_without_parts_says_so():
    text = BOUNCE[:BOUNCE.index("[[collider]]")]
    with pytest.raises(SceneError, match="the scene has no collider, fixed region or wall"):
        loads(f'{text}\n[[quantity]]\ntype = "force"\npart = "floor"\n')


def test_three_dimensions():
    text = BOUNCE.replace("dim = 2", "dim = 3")
    for old, new in (("[0.2, 0.3]", "[0.2, 0.3, 0.0]"), ("[0.6, 0.7]", "[0.6, 0.7, 0.4]"),
                     ("[0.0, -9.8]", "[0.0, -9.8, 0.0]"), ("[0.5, -1.0]", "[0.5, -1.0, 0.0]"),
                     ("[0.0, 0.1]", "[0.0, 0.1, 0.0]"), ("[0.0, 1.0]", "[0.0, 1.0, 0.0]")):
        text = text.replace(old, new)
    scene = loads(text + '\n[[quantity]]\ntype = "front"\nside = "z+"\n[[quantity]]\n'
                  'type = "region"\nlower = [0, 0, 0]\nupper = [1, 1, 0.5]\n')
    assert [one.text for one in scene.quantity] == ["front:z+", "region:0,0,0,1,1,0.5"]
    assert validate_scene(scene) == scene
