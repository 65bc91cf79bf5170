"""List the ingredients of a scene, each with the edit of the scene's tables that removes it.

An ingredient has one entry for each replacement, such as PIC or FLIP for the affine field. Parts
without a name get one by their place, as in `sweep.conditions`, so that an entry means the same
part after others were removed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import msgspec

from ..body import AFFINE
from ..materials.moduli import lame
from ..scene.validate import validate_scene
from ..sweep.setting import (
    change_cfl,
    change_integrator,
    change_transfer,
    in_seconds,
    scale_points,
)

FLIP = "flip 0.95"          # the usual blend that carries no affine field
FEWER_FRAMES = 10           # times fewer of them
FEWER_POINTS = 0.75         # of the points per axis, of samplings that are not per cell
CFL = 0.5                   # share of the stable step of explicit steps
MIRROR = "mirror "          # begins the names of the walls of symmetric halves
FLOW_TERMS = {              # a term of a flow: its name, and its parameter, which may be 0
    "von_mises_hardening": ("hardening", "xi"),
    "von_mises_softening": ("softening", "theta"),
    "herschel_bulkley": ("viscosity", "eta"),
    "drucker_prager": ("internal friction", "friction_angle"),
}


class Half(NamedTuple):
    """The upper half of a scene that a plane mirrors."""

    axis: int
    c: float            # position of the plane [m]
    halved: tuple       # names of the bodies and parts that the plane cuts in two


@dataclass(frozen=True)
class Removal:
    """An ingredient, what stands in its place, and the edit of plain tables that replaces it."""

    ingredient: str
    edit: Callable              # tables -> None
    replacement: str = ""       # nothing
    body: str | None = None     # that is removed, and so not compared
    half: Half | None = None    # that is left of a symmetric scene
    axes: tuple | None = None   # that are left of a scene in 3D
    length: float = 1.0         # of the matter along the axis that is removed [m]
    is_output: bool = False     # the lean scene keeps it: output is the user's choice

    @property
    def label(self):
        """Return ingredient and replacement in words; equal labels are equal removals."""
        return self.ingredient + (f" ({self.replacement} instead)" if self.replacement else "")


def named_scene(scene):
    """Return a scene with times instead of numbers of steps, and a name for each part."""
    tables = lists_and_tables(scene)
    for key in ("collider", "fixed"):
        used = {part.get("name") for part in tables.get(key, ())}
        for k, part in enumerate(tables.get(key, ())):
            if not part.get("name"):
                part["name"] = unused_name(f"{key}{k}", used)
    return validate_scene(tables)


def lists_and_tables(scene):
    """Return the plain tables of a scene in seconds, with lists where a scene has tuples."""
    return msgspec.json.decode(msgspec.json.encode(in_seconds(scene)))


def unused_name(name, used):
    """Return a name, with an underscore or more where it is used."""
    while name in used:
        name += "_"
    return name


def removed(scene, removal):
    """Return a scene after a `Removal`. Raises SceneError where it is none then."""
    tables = lists_and_tables(scene)
    removal.edit(tables)
    return validate_scene(tables)


def removals_of(scene):
    """Return the removals that a scene with named parts offers, a tuple of `Removal`: first those
    that save time, last those that may cost some.
    """
    return (*part_removals(scene), *contact_removals(scene), *load_removals(scene),
            *(removal for body in scene.body for removal in body_removals(scene, body)),
            *boundary_removals(scene), *resolution_removals(scene), *scheme_removals(scene))


def boundary_removals(scene):
    """Yield the removal of conditions at surfaces, which nodes behind them may replace."""
    if scene.boundary == "surface" and scene.collider:
        yield Removal("conditions at the surface", at_nodes, "at nodes")


def at_nodes(tables):
    """Impose the conditions of colliders at nodes."""
    tables["boundary"] = "nodes"


# the transfer

def scheme_removals(scene):
    """Yield the removals of the transfer's ingredients."""
    scheme = scene.step_scheme
    if scheme.transfer in AFFINE:
        for text, name in (("pic", "PIC"), (FLIP, "FLIP 0.95")):
            yield Removal("affine field", transfer_edit(text), name)
    if scheme.transfer == "flip" and scheme.flip > 0.0:
        yield Removal("FLIP part", transfer_edit("pic"), "PIC")
    for key, name in (("rpic", "RPIC damping"), ("relaxation", "relaxation of the transfer"),
                      ("mass_eps", "mass added to nodes"),
                      ("gravity_on_empty", "gravity on empty nodes"),
                      ("f_bar", "averaged volumes (F-bar)")):
        if getattr(scheme, key):
            yield Removal(name, default_edit("scheme", key))
    if can_be_single(scene):
        yield Removal("double precision", to_single, "single")
    if scheme.gimp:
        yield Removal("averages over particles (GIMP)", degree_edit(1), "linear splines")
    elif scheme.degree > (2 if scheme.transfer in AFFINE else 1):
        yield Removal(f"splines of degree {scheme.degree}", degree_edit(scheme.degree - 1),
                      f"degree {scheme.degree - 1}")


def can_be_single(scene):
    """Return whether a scene is of double precision and could be of single."""
    return scene.integrator == "explicit" and scene.scheme.precision == "double" and not (
        scene.contact or any(body.material.is_neural for body in scene.body))


def to_single(tables):
    """Store and compute in single precision."""
    tables["scheme"]["precision"] = "single"


def transfer_edit(text):
    """Return the edit to another transfer."""
    return lambda tables: change_transfer(tables, text)


def degree_edit(degree):
    """Return the edit to splines of another degree."""
    def edit(tables):
        tables["scheme"] |= {"degree": degree, "gimp": 0.0}
    return edit


def default_edit(table, key):
    """Return the edit that gives a key of a table its default."""
    return lambda tables: tables[table].pop(key)


# resolution and integration

def resolution_removals(scene):
    """Yield the removals of particles and of implicit steps."""
    samplings = [body.sampling for body in scene.body if body.shape is not None]
    if any(getattr(sampling, "per_cell", None) != 1 for sampling in samplings):
        texts = dict.fromkeys(map(points_text, samplings))
        yield Removal(f"particles, {', '.join(texts)}", remove_points, "fewer")
    if scene.integrator != "explicit":
        yield Removal("implicit steps", step_explicitly, "explicit")


def points_text(sampling):
    """Return the number of points of a sampling in words."""
    if getattr(sampling, "per_cell", None) is not None:
        return f"{sampling.per_cell} per cell and axis"
    values = {key: getattr(sampling, key, None) for key in ("counts", "count", "spacing", "radius")}
    return next(f"{key} {value}" for key, value in values.items() if value is not None)


def remove_points(tables):
    """Take one point less per cell and axis, or a quarter less per axis, but at least one."""
    for body in tables["body"]:
        sampling = body["sampling"]
        if body.get("shape") is None:
            continue
        if sampling.get("per_cell") is None:
            scale_points(sampling, FEWER_POINTS, tables["dim"], per_cell=False)
        else:
            sampling["per_cell"] = max(sampling["per_cell"] - 1, 1)
    if tables["scheme"].get("gimp"):
        tables["scheme"]["gimp"] = max(tables["scheme"]["gimp"] - 1.0, 1.0)


def step_explicitly(tables):
    """Step explicitly, at the usual share of the stable step."""
    change_integrator(tables, "explicit")
    change_cfl(tables, CFL)


# bodies

def body_removals(scene, body):
    """Yield the removals of a body, of its velocity and of its material's ingredients."""
    k, name, material = scene.body.index(body), body.name, body.material
    if len(scene.body) > 1:
        yield Removal(f"body {name}", body_edit(k), body=name)
    if body.velocity.moves:
        yield Removal(f"initial velocity of {name}",
                      lambda tables: tables["body"][k].pop("velocity"))
    if material.is_neural:
        return
    flow = material.flow
    if flow.name != "none":
        yield Removal(f"return map of {name}", material_edit(k, flow={"type": "none"}))
    term, key = FLOW_TERMS.get(flow.name, ("", ""))
    if key and getattr(flow, key):
        yield Removal(f"{term} of {name}", lambda tables: remove_term(tables["body"][k], key))
    if material.law != "fluid":
        fluid = {"law": "fluid", "lam": bulk_response(material, scene.dim), "E": None, "nu": None}
        yield Removal(f"tensor F of {name}", material_edit(k, **fluid, flow={"type": "none"}),
                      "J of a fluid")


def body_edit(k):
    """Return the edit that takes body k away, and its contacts."""
    def edit(tables):
        name = tables["body"].pop(k)["name"]
        for contact in tables["contact"]:
            contact["bodies"] = [other for other in contact["bodies"] if other != name]
        tables["contact"] = [contact for contact in tables["contact"] if len(contact["bodies"]) > 1]
    return edit


def material_edit(k, **values):
    """Return the edit that gives keys of the material of body k other values."""
    return lambda tables: tables["body"][k]["material"].update(values)


def remove_term(body, key):
    """Take a term out of a body's flow; von Mises flow on Hencky's law then has no history."""
    material = body["material"]
    flow = material["flow"]
    if flow["type"].startswith("von_mises_") and material["law"] == "hencky":
        flow["type"], flow[key] = "von_mises", None
    else:
        flow[key] = 0.0


def bulk_response(material, dim):
    """Return the modulus lam + 2 mu/d [Pa] of a change of volume in d dimensions."""
    mu, lam = lame(material.E, material.nu)
    return lam + 2.0 * mu / dim


# boundary conditions and loads

def part_removals(scene):
    """Yield the removals of colliders, regions, walls and of their friction and motion."""
    for key, parts in (("collider", scene.collider), ("fixed", scene.fixed)):
        for k, part in enumerate(parts):
            if part.name.startswith(MIRROR):
                continue
            word = "region" if key == "fixed" else key
            yield Removal(f"{word} {part.name}", item_edit(key, k))
            if getattr(part, "friction", 0.0):
                yield Removal(f"friction of {word} {part.name}", item_edit(key, k, "friction"))
            if getattr(part, "kind", "") == "separate":
                yield Removal(f"separation from {word} {part.name}", kind_edit(key, k), "slip")
            if part.motion.translation is not None or part.motion.rotation is not None:
                yield Removal(f"motion of {word} {part.name}", rest_edit(key, k))
    if scene.walls is not None:
        yield Removal("walls", lambda tables: tables.pop("walls"))
        if scene.walls.friction:
            yield Removal("friction of walls", default_edit("walls", "friction"))
    if scene.clip is not None:
        yield Removal("clip", lambda tables: tables.pop("clip"))


def contact_removals(scene):
    """Yield the removals of contacts of bodies, which one velocity field replaces, and of their
    friction.
    """
    for k, contact in enumerate(scene.contact):
        bodies = ", ".join(contact.bodies)
        yield Removal(f"contact of {bodies}", item_edit("contact", k), "one velocity field")
        if contact.friction:
            yield Removal(f"friction of {bodies}", item_edit("contact", k, "friction"))


def item_edit(key, k, inner=None):
    """Return the edit that takes item k of a list away, or a key of that item."""
    return lambda tables: tables[key].pop(k) if inner is None else tables[key][k].pop(inner)


def kind_edit(key, k):
    """Return the edit to a part that matter slides along and does not leave."""
    return lambda tables: tables[key][k].update(kind="slip")


def rest_edit(key, k):
    """Return the edit that leaves a part where it is at the start."""
    def edit(tables):
        motion = tables[key][k]["motion"]
        motion["translation"] = motion["rotation"] = None
        if not motion["angle"]:
            tables[key][k].pop("motion")
    return edit


def load_removals(scene):
    """Yield the removals of gravity and of frames."""
    if scene.gravity is not None and any(scene.gravity):
        yield Removal("gravity", lambda tables: tables.pop("gravity"))
    for key, unit in (("interval", " s"), ("every", " steps")):
        every = getattr(scene, key)
        if every is not None:
            yield Removal(f"frames every {every:g}{unit}", frames_edit(key), "a tenth",
                          is_output=True)


def frames_edit(key):
    """Return the edit to fewer frames."""
    def edit(tables):
        tables[key] = min(FEWER_FRAMES * tables[key], tables["end"] if key == "interval" else 10**9)
    return edit
