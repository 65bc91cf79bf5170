"""Settings: a scene with another grid spacing, particles, time step, transfer or integrator.

A setting is a dictionary of some of these knobs; what it leaves out stays as the scene says.

    scene       another scene of the same problem, by its name: with a learned law, for instance
    dx          factor of the grid spacing; points per cell stay, and the time step goes along
    particles   factor of the points per cell and axis
    sampling    "regular", "jittered" or "poisson", with as many points per cell; 2 per axis where
                the scene gives them otherwise
    cfl         share of the stable time step (of an implicit step: cells that a particle crosses)
    degree      of the B-spline: 1, 2 or 3
    transfer    "mls", "apic", "flip 0.95" (with its share of FLIP), "apic rpic 0.5", "pic",
                "mls relaxation 1e-3" (with its time in s, whatever the grid), ...
    gimp        particles per cell and axis over which linear splines are averaged; 0: B-splines
    f_bar       whether explicit steps average volumes over cells, against locking
    precision   "double" or "single", of explicit steps
    integrator  "explicit", or the word of an implicit method such as "hot-plus"
    eps         tolerance of an implicit step
    boundary    "nodes" or "surface": where the conditions of colliders hold
"""

import re
from dataclasses import dataclass
from math import inf, isclose

from ..body import AFFINE
from ..scene import SceneError
from ..scene.validate import plain, validate_scene

USUAL_PER_CELL = 2      # points per cell and axis, where the scene does not say
DIGITS = 12             # of a scaled dx, without the round-off of the product


@dataclass(frozen=True)
class Setting:
    """Knobs and their values, in the order of `KNOBS`; equal settings are equal and hashable."""

    items: tuple = ()

    def __or__(self, other):
        return setting(**(dict(self.items) | dict(other.items)))

    def get(self, knob, default=None):
        """Return the value of a knob."""
        return dict(self.items).get(knob, default)

    @property
    def text(self):
        """Return the setting in words."""
        texts = [f"{name} {_shown(name, value)}" for name, value in self.items]
        return ", ".join(texts) or "as given"


def setting(**knobs):
    """Return the `Setting` of some knobs. Raises ValueError for an unknown one."""
    if unknown := sorted(knobs.keys() - set(KNOBS)):
        raise ValueError(f"knob {unknown[0]!r}: expected one of {', '.join(KNOBS)}")
    return Setting(tuple((name, knobs[name]) for name in KNOBS if name in knobs))


def _shown(name, value):
    if name in ("dx", "particles"):
        return f"x {value:.4g}"
    return str(value).lower() if isinstance(value, bool) else str(value)


def scene_at(scene, chosen, others=None):
    """Return a scene under a `Setting`, or the one of `others`, {name: scene}, that it names.

    Raises SceneError where the two do not fit.
    """
    tables = in_seconds(scene if chosen.get("scene") is None else others[chosen.get("scene")])
    for name, value in chosen.items:
        if name != "scene":
            CHANGES[name](tables, value)
    return validate_scene(tables)


def in_seconds(scene):
    """Return the tables of a scene whose end and frames are times, not counts of steps.

    Raises SceneError for a number of steps without a time step, and for sources and sinks, with
    which runs have no material points in common.
    """
    if scene.sink or any(body.source is not None for body in scene.body):
        raise SceneError("sources or sinks: runs are compared by material points that are there "
                         "from the start to the end; expected a scene without [body.source] and "
                         "[[sink]]")
    tables = {key: value for key, value in plain(scene).items() if value is not None}
    dt = tables.get("dt")
    if "steps" in tables and dt is None:
        raise SceneError(f"steps = {tables['steps']} without dt: runs with other settings end at "
                         "the same time; expected `end`, or `dt` with `steps`")
    if "steps" in tables:
        tables["end"] = tables.pop("steps") * dt
    if "every" in tables:
        every = tables.pop("every")
        if dt is not None:
            tables["interval"] = every * dt
    return tables


# knobs: each changes the tables of a scene

def scale_dx(tables, factor):
    """Multiply the grid spacing; walls, which are counted in nodes, stay where they are."""
    tables["dx"] = float(f"{tables['dx'] * factor:.{DIGITS}g}")
    if "relaxation" in tables["scheme"]:
        tables["scheme"]["relaxation"] *= factor
    if "dt" in tables:
        tables["dt"] = min(tables["dt"] * factor, tables.get("interval", inf))
    else:
        scale_longest(tables, factor)
    if tables.get("walls") is not None:
        for key, inner in (("low", 1), ("high", -1)):
            nodes = tables["walls"].get(key)
            if nodes is not None:
                tables["walls"][key] = [_node_at(node, inner, factor) for node in nodes]
    for body in tables["body"]:
        sampling = body["sampling"]
        if body.get("shape") is not None:
            scale_points(sampling, 1.0 / factor, tables["dim"], per_cell=False)


def scale_longest(tables, factor):
    """Multiply the bound of a time step that is not fixed; on a finer grid, frames bound it too,
    since no step is longer than their interval.
    """
    bound = tables.get("longest") or inf
    if factor < 1.0:
        bound = min(bound, tables.get("interval") or inf)
    if bound < inf:
        tables["longest"] = bound * factor


def _node_at(node, inner, factor):
    """Return the index of a wall's limit on a grid with spacing times factor."""
    if node == "open":
        return node
    index = (node - inner) / factor
    if not isclose(index, round(index), abs_tol=1e-6):
        raise SceneError(f"walls: node {node - inner} lies between two nodes of a grid with "
                         f"{factor:g} times the spacing; give the wall as a collider instead")
    return round(index) + inner


def scale_particles(tables, factor):
    """Multiply the points per cell and axis of all bodies with a shape, and those of GIMP."""
    shaped = [body for body in tables["body"] if body.get("shape") is not None]
    if not shaped:
        raise SceneError("particles: the bodies are arrays, whose number of particles is given")
    for body in shaped:
        scale_points(body["sampling"], factor, tables["dim"], per_cell=True)
    if tables["scheme"].get("gimp"):
        tables["scheme"]["gimp"] = max(round(tables["scheme"]["gimp"] * factor), 1)


def scale_points(sampling, factor, dim, per_cell):
    """Multiply the points per axis of a sampling; per_cell: also where they are per cell."""
    if sampling.get("counts") is not None:
        sampling["counts"] = [max(round(n * factor), min(n, 2)) for n in sampling["counts"]]
    if sampling.get("count") is not None:
        sampling["count"] = max(round(sampling["count"] * factor**dim), 1)
    for key in ("spacing", "radius"):
        if sampling.get(key) is not None:
            sampling[key] /= factor
    if per_cell and sampling.get("per_cell") is not None:
        sampling["per_cell"] = max(round(sampling["per_cell"] * factor), 1)


def change_sampling(tables, kind):
    """Sample all bodies with a shape in another way, with two points per cell and axis where they
    are not given per cell.
    """
    for body in tables["body"]:
        if body.get("shape") is not None:
            per_cell = body["sampling"].get("per_cell") or USUAL_PER_CELL
            body["sampling"] = {"type": kind, "per_cell": per_cell}


def change_cfl(tables, share):
    """Follow the stable time step; a fixed dt, and a bound on it, are dropped."""
    tables.pop("dt", None)
    tables.pop("longest", None)
    tables["cfl"] = share
    if tables["integrator"] == "explicit":
        tables["unstable"] = "refuse"


def change_degree(tables, degree):
    """Take B-splines of another degree, in place of GIMP too."""
    tables["scheme"] |= {"degree": degree, "gimp": 0.0}


def change_transfer(tables, text):
    """Take another transfer, with its blend; an affine one knows no GIMP."""
    number = r"([0-9.]+(?:e-?[0-9]+)?)"
    match = re.fullmatch(rf"(\w+)(?: {number}| (rpic|relaxation) {number})?", text)
    if match is None or (match[2] and match[1] != "flip"):
        raise SceneError(f"transfer {text!r}: expected a text such as mls, flip 0.95, apic rpic "
                         "0.5 or mls relaxation 1e-3")
    name, share, key, value = match.groups()
    scheme = {"transfer": name, "flip": float(share or 1.0), "rpic": 0.0, "relaxation": 0.0}
    if key:
        scheme[key] = float(value)
    if name == "flip" or key == "relaxation":
        scheme["mass_eps"] = 0.0
    if name in AFFINE:
        scheme["gimp"] = 0.0
    tables["scheme"] |= scheme


def change_gimp(tables, per_cell):
    """Average linear splines over so many particles per cell and axis, or take B-splines for 0."""
    tables["scheme"]["gimp"] = per_cell


def change_integrator(tables, word):
    """Step explicitly, or by an implicit method, whose transfer is APIC unless it is chosen, which
    averages no volumes or splines and does not relax, in double precision, and whose conditions
    hold at nodes.
    """
    was_explicit = tables["integrator"] == "explicit"
    tables["integrator"] = word
    if word == "explicit":
        tables.pop("solver", None)
        tables.pop("longest", None)
        return
    tables["boundary"] = "nodes"
    tables["scheme"] |= {"f_bar": False, "gimp": 0.0, "relaxation": 0.0, "precision": "double"}
    if was_explicit and tables["scheme"].get("transfer") in (None, "mls"):
        tables["scheme"]["transfer"] = "apic"


def change_f_bar(tables, averaged):
    """Average volumes over cells, or not."""
    if averaged and tables["integrator"] != "explicit":
        raise SceneError("f_bar = true: implicit steps average no volumes; expected an explicit "
                         "integrator")
    tables["scheme"]["f_bar"] = averaged


def change_precision(tables, precision):
    """Store and compute in floats of another size."""
    if precision == "single" and tables["integrator"] != "explicit":
        raise SceneError('precision = "single": implicit steps compute in double; expected an '
                         "explicit integrator")
    tables["scheme"]["precision"] = precision


def change_eps(tables, eps):
    """Solve implicit steps to another tolerance."""
    if tables["integrator"] == "explicit":
        raise SceneError(f"eps = {eps}: an explicit step solves nothing; expected an implicit one")
    tables["solver"] = (tables.get("solver") or {}) | {"eps": eps}


def change_boundary(tables, boundary):
    """Impose the conditions of colliders at nodes or at their surface."""
    if not tables.get("collider"):
        raise SceneError(f"boundary = {boundary!r}: the scene has no collider")
    tables["boundary"] = boundary


CHANGES = {
    "dx": scale_dx, "particles": scale_particles, "sampling": change_sampling,
    "integrator": change_integrator, "cfl": change_cfl, "degree": change_degree,
    "transfer": change_transfer, "gimp": change_gimp, "f_bar": change_f_bar,
    "precision": change_precision, "eps": change_eps, "boundary": change_boundary,
}
KNOBS = ("scene", *CHANGES)
