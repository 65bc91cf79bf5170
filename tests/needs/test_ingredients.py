"""Each ingredient is offered where the scene has it, and its removal changes it alone."""

import pytest
from needs_toys import BLOCK, FLOOR, HEAD, SCENE, variant_of

from mpm_ref.needs.ingredients import named_scene, removed
from mpm_ref.scene import loads
from mpm_ref.scene.validate import plain

EXTRAS = HEAD + """
scheme = { transfer = "apic", degree = 3, rpic = 0.1, mass_eps = 1e-9, gravity_on_empty = true,\
  f_bar = true }
walls = { low = [1, "open"], high = ["open", "open"], friction = 0.2 }
clip = { lower = [-1.0, -1.0], upper = [1.0, 1.0] }
interval = 0.002
""" + BLOCK.replace("von_mises", "von_mises_hardening").replace("1e9", "1e9, xi = 0.1") + """
[[collider]]
name = "press"
shape = { type = "box", lower = [0.3, 0.4], upper = [0.5, 0.5] }
kind = "separate"
motion = { translation = { type = "steady", rate = [0.0, -1.0] } }

[[fixed]]
region = { type = "box", lower = [0.3, 0.1], upper = [0.5, 0.11] }
"""
IMPLICIT = HEAD.replace("dt = 0.001", "") + 'integrator = "hot"' + BLOCK.replace(
    ', flow = { type = "von_mises", tau_y = 1e9 }', "").replace("hencky", "fixed_corotated")


def without(text, label):
    """A scene after the removal with a label."""
    variant = variant_of(text)
    return removed(variant.scene, variant.offers[label])


def changed_keys(text, label):
    """The keys at which the removal changes the scene's tables."""
    before, after = plain(variant_of(text).scene), plain(without(text, label))
    return {key for key in before if before[key] != after[key]}


@pytest.mark.parametrize(("label", "key", "value"), [
    ("affine field (PIC instead)", "transfer", "pic"),
    ("affine field (FLIP 0.95 instead)", "transfer", "flip"),
    ("RPIC damping", "rpic", 0.0),
    ("mass added to nodes", "mass_eps", 0.0),
    ("gravity on empty nodes", "gravity_on_empty", False),
    ("averaged volumes (F-bar)", "f_bar", False),
    ("splines of degree 3 (degree 2 instead)", "degree", 2),
    ("double precision (single instead)", "precision", "single"),
])
def test_removal_from_the_transfer(label, key, value):
    assert changed_keys(EXTRAS, label) == {"scheme"}
    assert getattr(without(EXTRAS, label).scheme, key) == value


def test_removal_of_the_relaxation():
    text = HEAD + "scheme = { relaxation = 1e-3 }" + BLOCK
    assert without(text, "relaxation of the transfer").scheme.relaxation == 0.0


def test_gimp_falls_back_on_the_splines_that_it_averages():
    text = HEAD + 'scheme = { transfer = "flip", gimp = 2 }' + BLOCK
    assert not any("degree" in label for label in variant_of(text).offers)
    scheme = without(text, "averages over particles (GIMP) (linear splines instead)").scheme
    assert (scheme.degree, scheme.gimp) == (1, 0.0)
    fewer = without(text, "particles, 2 per cell and axis (fewer instead)")
    assert (fewer.body[0].sampling.per_cell, fewer.scheme.gimp) == (1, 1.0)


def test_flip_part_and_degree_of_a_transfer_without_affine_field():
    text = HEAD + 'scheme = { transfer = "flip", flip = 0.9 }' + BLOCK
    offers = variant_of(text).offers
    assert not any("affine" in label for label in offers)
    assert without(text, "FLIP part (PIC instead)").scheme.transfer == "pic"
    assert without(text, "splines of degree 2 (degree 1 instead)").scheme.degree == 1


@pytest.mark.parametrize(("label", "key"), [
    ("walls", "walls"), ("friction of walls", "walls"), ("clip", "clip"), ("gravity", "gravity"),
    ("collider press", "collider"), ("separation from collider press (slip instead)", "collider"),
    ("motion of collider press", "collider"), ("region fixed0", "fixed"),
    ("frames every 0.002 s (a tenth instead)", "interval"),
    ("return map of block", "body"), ("hardening of block", "body"),
    ("initial velocity of block", "body"), ("tensor F of block (J of a fluid instead)", "body"),
    ("particles, 2 per cell and axis (fewer instead)", "body"),
])
def test_removal_changes_one_table(label, key):
    assert changed_keys(EXTRAS, label) == {key}


def test_parts_after_removal():
    assert without(EXTRAS, "walls").walls is None
    assert without(EXTRAS, "friction of walls").walls.friction == 0.0
    assert without(EXTRAS, "collider press").collider == ()
    press, = without(EXTRAS, "motion of collider press").collider
    assert press.motion.translation is None
    turned = EXTRAS.replace("motion = { translation", "motion = { angle = 10.0, translation")
    press, = without(turned, "motion of collider press").collider
    assert (press.motion.translation, press.motion.angle) == (None, 10.0)
    press, = without(EXTRAS, "separation from collider press (slip instead)").collider
    assert press.kind == "slip"
    assert without(EXTRAS, "frames every 0.002 s (a tenth instead)").interval == 0.02


def test_friction_of_a_collider_without_name():
    floor, other = without(SCENE, "friction of collider collider1").collider
    assert (floor.name, other.friction) == ("floor", 0.0)


def test_materials_after_removal():
    assert without(EXTRAS, "return map of block").body[0].material.flow.name == "none"
    flow = without(EXTRAS, "hardening of block").body[0].material.flow
    assert (flow.name, flow.tau_y, flow.xi) == ("von_mises", 1e9, None)
    fluid = without(EXTRAS, "tensor F of block (J of a fluid instead)").body[0].material
    E, nu = 1e5, 0.3
    mu, lam = E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    assert (fluid.law, fluid.flow.name) == ("fluid", "none")
    assert fluid.lam == pytest.approx(lam + mu)


@pytest.mark.parametrize(("law", "flow", "label", "key"), [
    ("neo_hookean", '{ type = "herschel_bulkley", sigma_y = 1.0, eta = 2.0 }', "viscosity", "eta"),
    ("hencky", '{ type = "drucker_prager", friction_angle = 30.0 }', "internal friction",
     "friction_angle"),
    ("fixed_corotated", '{ type = "von_mises_softening", tau_y = 1.0, theta = 2.0 }', "softening",
     "theta"),
])
def test_term_of_a_flow_becomes_zero(law, flow, label, key):
    text = HEAD + BLOCK.replace('"hencky"', f'"{law}"').replace(
        '{ type = "von_mises", tau_y = 1e9 }', flow)
    left = without(text, f"{label} of block").body[0].material.flow
    assert (left.name, getattr(left, key)) == (loads(text).body[0].material.flow.name, 0.0)


def test_implicit_steps_become_explicit_at_a_stable_step():
    scene = without(IMPLICIT, "implicit steps (explicit instead)")
    assert (scene.integrator, scene.solver, scene.cfl) == ("explicit", None, 0.5)


@pytest.mark.parametrize(("sampling", "key", "value"), [
    ('{ type = "regular", per_cell = 3 }', "per_cell", 2),
    ('{ type = "poisson", count = 160 }', "count", 90),
    ('{ type = "lattice", counts = [8, 12] }', "counts", (6, 9)),
])
def test_fewer_points(sampling, key, value):
    text = HEAD + BLOCK + f"sampling = {sampling}\n"
    label, = (label for label in variant_of(text).offers if label.startswith("particles"))
    assert getattr(without(text, label).body[0].sampling, key) == value


def test_one_point_per_cell_is_not_taken_away():
    text = HEAD + BLOCK + 'sampling = { type = "regular", per_cell = 1 }\n'
    assert not any(label.startswith("particles") for label in variant_of(text).offers)


def test_single_body_and_zero_gravity_are_not_offered():
    offers = variant_of(HEAD.replace("-9.8", "0.0") + BLOCK + FLOOR).offers
    assert not {"body block", "gravity"} & offers.keys()
    assert {"body block", "body distant", "gravity"} <= variant_of(SCENE).offers.keys()


def test_names_by_place_stay_after_removals_and_are_unique():
    text = HEAD + BLOCK + FLOOR + '\n[[collider]]\nname = "collider1_"\nshape = { type = ' \
        '"sphere", center = [9.0, 9.0], radius = 1.0 }\n' + FLOOR.replace('"floor"', '"collider1"')
    names = [part.name for part in named_scene(loads(text)).collider]
    assert names == ["floor", "collider1__", "collider1_", "collider1", "collider4"]
    variant = variant_of(HEAD + BLOCK + FLOOR)
    left = variant.without(variant.offers["collider floor"])
    assert "collider collider1" in left.offers


CONTACT = """
[[contact]]
bodies = ["block", "distant"]
friction = 0.2
"""


def test_contact_of_bodies_is_an_ingredient():
    label = "contact of block, distant (one velocity field instead)"
    assert without(SCENE + CONTACT, label).contact == ()
    assert changed_keys(SCENE + CONTACT, label) == {"contact"}
    contact, = without(SCENE + CONTACT, "friction of block, distant").contact
    assert (contact.bodies, contact.friction) == (("block", "distant"), 0.0)
    assert not any("contact" in label for label in variant_of(SCENE).offers)


def test_a_body_takes_its_contacts_along():
    assert without(SCENE + CONTACT, "body distant").contact == ()
    third = BLOCK.replace('"block"', '"third"').replace("[0.3, 0.1]", "[1.3, 0.1]").replace(
        "[0.5, 0.3]", "[1.5, 0.3]")
    three = SCENE + third + CONTACT.replace('"distant"]', '"distant", "third"]')
    contact, = without(three, "body distant").contact
    assert contact.bodies == ("block", "third")


def test_conditions_at_the_surface_are_an_ingredient_where_there_are_colliders():
    label = "conditions at the surface (at nodes instead)"
    at_surface = 'boundary = "surface"\n' + EXTRAS
    assert changed_keys(at_surface, label) == {"boundary"}
    assert label not in variant_of(EXTRAS).offers
