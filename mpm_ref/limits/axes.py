"""The axes along which a scene is changed by a factor, each with what it changes.

    time_step   a fixed dt; else `cfl`, the share of the stable one (and the bound `longest`)
    stiffness   E and lam of all bodies
    poisson     1 - 2 nu of all bodies, the distance of nu from 1/2
    density     density of all bodies
    speed       initial velocities, and all displacements of parts in the times that they have
    gravity     gravity
    friction    tangent of the friction angle of all flows, and friction of colliders, walls
                and contacts
    yield       sigma_y and tau_y of all flows
    particles   points per cell and axis, whole numbers
    size        all lengths (see `geometry`); velocities, gravity and times stay
    origin      distance of the scene from where it stands: a shift by (factor - 1) sizes of its
                bodies along each axis, in whole cells

All else, a fixed dt included, stays as the scene says. time_step, particles and origin do not
change the physical problem: they are numerical.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import atan, degrees, floor, log10, radians, tan

import numpy as np

from ..sweep.quantity import OutputQuantity
from ..sweep.setting import USUAL_PER_CELL, scale_particles
from .geometry import PATHS, multiply, scale_lengths, shift_points

USUAL_CFL = 0.5         # share of the stable time step, where the scene does not say
MOST_LONGER = 20.0      # times the scene's own time that a run may take
DECADES = (10.0, 100.0, 1000.0)
SHIFTS = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)       # sizes
SHORTER = (0.5, 0.2, 0.1)                       # steps that are tried, without bisection
LEAST_NU = -0.9         # the least Poisson's ratio of a search; no scene has one below -1
LOCATED = ("path", "region", "mean")            # kinds of quantities with coordinates
MOST_POINTS = 4         # times the points per cell and axis
DOWN, UP = "down", "up"


@dataclass(frozen=True)
class ScaleAxis:
    """An axis of change."""

    name: str
    text: str                       # in words, the subject of "may grow 2 times"
    change: Callable                # (tables, factor, size [m]): changes plain tables in place
    reading: Callable               # (tables) -> text of a value that it changes; "" where absent
    is_numerical: bool = False      # the physical problem stays
    is_geometric: bool = False      # coordinates of the scene change
    is_inverse: bool = False        # `text` names what falls as the factor grows


def rungs(axis, tables, direction):
    """Return the factors that are tried first along an axis, from 1 outward."""
    if axis.name == "origin":
        return SHIFTS if direction == UP else ()
    if axis.name == "particles":
        return point_factors(tables, direction)
    if axis.name == "time_step" and direction == DOWN:
        return SHORTER
    return DECADES if direction == UP else tuple(1.0 / factor for factor in DECADES)


def searched_rungs(axis, tables, direction):
    """Return the rungs of a search: `rungs`, but none past values that no scene can have."""
    factors = rungs(axis, tables, direction)
    if axis.name != "poisson" or direction == DOWN:
        return factors
    nus = [body["material"].get("nu") for body in tables["body"]]
    most = min((0.5 - LEAST_NU) / (0.5 - nu) for nu in nus if nu is not None)
    if most >= factors[-1]:
        return factors
    return (*(factor for factor in factors if factor < most), *(most,) * (most > 1.0))


def is_discrete(axis, direction):
    """Return whether nothing between the rungs is tried."""
    return axis.name == "particles" or (axis.name == "time_step" and direction == DOWN)


def point_factors(tables, direction):
    """Return factors of the points per cell and axis that give whole numbers, where the scene has
    such a number, and take at most `MOST_LONGER` times as long.
    """
    n = next((body["sampling"].get("per_cell") for body in tables["body"]
              if body.get("shape") is not None), None) or USUAL_PER_CELL
    if direction == DOWN:
        return tuple(k / n for k in range(n - 1, 0, -1))
    numbers = sorted({n + 1, n + 2, *(m * n for m in range(2, MOST_POINTS + 1))})
    return tuple(k / n for k in numbers if (k / n) ** tables["dim"] <= MOST_LONGER)


def applicable(tables, quantities):
    """Return ([axes that apply to a scene], {name: why another does not})."""
    located = [text for text in quantities if OutputQuantity(text).kind in LOCATED]
    axes, reasons = [], {}
    for axis in AXES:
        if not axis.reading(tables):
            reasons[axis.name] = ABSENT[axis.name]
        elif axis.is_geometric and located:
            reasons[axis.name] = f"the quantity {located[0]} has coordinates, which would change"
        else:
            axes.append(axis)
    return axes, reasons


# materials

def scale_material(keys):
    """Return the change that multiplies keys of all materials."""
    def change(tables, factor, size):
        for body in tables["body"]:
            multiply(body["material"], keys, factor)
    return change


def scale_poisson(tables, factor, size):
    """Multiply 1 - 2 nu of all bodies."""
    for body in tables["body"]:
        nu = body["material"].get("nu")
        if nu is not None:
            body["material"]["nu"] = 0.5 - 0.5 * factor * (1.0 - 2.0 * nu)


def rubbing(tables):
    """Return the tables that may have a friction: colliders, regions, walls, contacts."""
    return (*tables["collider"], *tables["fixed"], tables.get("walls") or {},
            *tables.get("contact", ()))


def scale_friction(tables, factor, size):
    """Multiply the tangent of all friction angles, and the friction of parts and contacts."""
    for part in rubbing(tables):
        multiply(part, ("friction",), factor)
    for body in tables["body"]:
        angle = body["material"]["flow"].get("friction_angle")
        if angle is not None:
            body["material"]["flow"]["friction_angle"] = degrees(atan(factor * tan(radians(angle))))


def scale_yield(tables, factor, size):
    """Multiply the yield stresses of all flows."""
    for body in tables["body"]:
        multiply(body["material"]["flow"], ("sigma_y", "tau_y"), factor)


def scale_density(tables, factor, size):
    """Multiply the densities of all bodies that have one."""
    for body in tables["body"]:
        multiply(body, ("density",), factor)


# motion

def scale_speed(tables, factor, size):
    """Multiply initial velocities, and the displacements of parts in the times that they have."""
    for body in tables["body"]:
        multiply(body["velocity"], ("linear", "angular"), factor)
    for schedule in schedules(tables):
        multiply(schedule, PATHS, factor)


def schedules(tables):
    """Return the schedules of all parts that move."""
    motions = [part["motion"] for key in ("collider", "fixed") for part in tables[key]]
    return [motion[key] for motion in motions for key in ("translation", "rotation")
            if motion.get(key) is not None]


def scale_gravity(tables, factor, size):
    """Multiply the acceleration of gravity."""
    multiply(tables, ("gravity",), factor)


# discretisation and place

def scale_time_step(tables, factor, size):
    """Multiply a fixed dt, or else the share of the stable one, the longest step, and the interval
    of frames, which bounds it.
    """
    if tables.get("dt") is None:
        tables["cfl"] = (tables.get("cfl") or USUAL_CFL) * factor
        multiply(tables, ("longest", "interval"), factor)
        return
    tables["dt"] *= factor
    if tables.get("interval") is not None:
        tables["interval"] = max(tables["interval"], tables["dt"])


def scale_origin(tables, factor, size):
    """Shift the scene by (factor - 1) sizes along each axis, in whole cells."""
    n = round((factor - 1.0) * size / tables["dx"])
    shift_points(tables, [n] * tables["dim"])


# readings: the value that an axis changes, of the first body or part that has one

def material_reading(*keys):
    """Return the reading of the first of some keys that a material has."""
    return lambda tables: first(tables, lambda body: body["material"], keys)


def poisson_reading(tables):
    """Return "nu = value" of the first material that has one, with three digits of its distance
    from 1/2; else "".
    """
    values = [body["material"]["nu"] for body in tables["body"]
              if body["material"].get("nu") is not None]
    if not values:
        return ""
    distance = abs(0.5 - values[0])
    return f"nu = {round(values[0], 2 - floor(log10(distance))):.15g}"


def flow_reading(*keys):
    """Return the reading of the first of some keys that a return map has."""
    return lambda tables: first(tables, lambda body: body["material"]["flow"], keys)


def friction_reading(tables):
    """Return the first friction angle, or else the friction of the first part that has some."""
    frictions = [part["friction"] for part in rubbing(tables) if part.get("friction")]
    return (flow_reading("friction_angle")(tables)
            or (f"friction = {frictions[0]:.6g}" if frictions else ""))


def first(tables, part, keys):
    """Return "key = value" of the first body whose part has one of some keys, else ""."""
    values = [(key, part(body)[key]) for body in tables["body"] for key in keys
              if part(body).get(key) is not None]
    return f"{values[0][0]} = {values[0][1]:.6g}" if values else ""


def speed_reading(tables):
    """Return the largest initial linear and angular speeds that are not zero, or that parts move;
    "" where nothing is driven.
    """
    texts = []
    for key, unit in (("linear", "m/s"), ("angular", "rad/s")):
        u = max(np.linalg.norm(body["velocity"].get(key) or 0.0) for body in tables["body"])
        if u > 0.0:
            texts.append(f"{key} speed {u:.6g} {unit}")
    return ", ".join(texts) or ("parts move" if schedules(tables) else "")


def gravity_reading(tables):
    """Return gravity, "" without."""
    g = np.linalg.norm(tables.get("gravity") or 0.0)
    return f"|g| = {g:.6g}" if g > 0.0 else ""


def time_step_reading(tables):
    """Return dt, or the share of the stable one."""
    if tables.get("dt") is not None:
        return f"dt = {tables['dt']:.6g}"
    return f"cfl = {tables.get('cfl') or USUAL_CFL:.6g}"


def point_reading(tables):
    """Return the points per cell and axis; "" where all bodies are arrays."""
    samplings = [body["sampling"] for body in tables["body"] if body.get("shape") is not None]
    if not samplings:
        return ""
    n = samplings[0].get("per_cell")
    return f"per_cell = {n}" if n else f"{samplings[0]['type']} sampling"


def size_reading(tables):
    """Return dx; "" where a body is an array, whose lengths stand in a file."""
    arrays = any(body.get("particles") is not None for body in tables["body"])
    return "" if arrays else f"dx = {tables['dx']:.6g}"


def change_points(tables, factor, size):
    """Multiply the points per cell and axis, rounded to whole numbers."""
    scale_particles(tables, factor)


def change_size(tables, factor, size):
    """Multiply all lengths."""
    scale_lengths(tables, factor)


AXES = (
    ScaleAxis("time_step", "the time step", scale_time_step, time_step_reading, is_numerical=True),
    ScaleAxis("stiffness", "the stiffness", scale_material(("E", "lam")),
              material_reading("E", "lam")),
    ScaleAxis("poisson", "Poisson's ratio", scale_poisson, poisson_reading, is_inverse=True),
    ScaleAxis("density", "the density", scale_density,
              lambda tables: first(tables, lambda body: body, ("density",))),
    ScaleAxis("speed", "the speed", scale_speed, speed_reading),
    ScaleAxis("gravity", "gravity", scale_gravity, gravity_reading),
    ScaleAxis("friction", "the friction (tangent)", scale_friction,
              friction_reading),
    ScaleAxis("yield", "the yield stress", scale_yield, flow_reading("sigma_y", "tau_y")),
    ScaleAxis("particles", "the number of points per cell and axis", change_points, point_reading,
              is_numerical=True),
    ScaleAxis("origin", "the distance from where it stands (in sizes)", scale_origin,
              lambda tables: "shift", is_numerical=True, is_geometric=True),
    ScaleAxis("size", "the size", change_size, size_reading, is_geometric=True),
)
AXIS = {axis.name: axis for axis in AXES}
ABSENT = {
    "time_step": "", "stiffness": "no material has E or lam", "poisson": "no material has nu",
    "density": "no body has a density", "speed": "nothing has a velocity of its own",
    "gravity": "there is none",
    "friction": "no material has a friction angle, no collider friction",
    "yield": "no material has a yield stress", "particles": "all bodies are arrays",
    "origin": "", "size": "a body is an array of particles, whose lengths stand in a file",
}
