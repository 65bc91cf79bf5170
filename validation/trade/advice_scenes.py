"""Small scenes on which the advice of `mpm-ref trade` is judged.

The rules of the search were chosen on results of the scenes in `TUNED` alone. Four have a closed
form: two of free flight, and two of a column between slip walls that is released under its weight,
standing or hanging, small strains of which obey the wave equation

    u_tt = c^2 u_yy - g,  u(0) = 0,  u_y(H) = 0,
    u = -g/c^2 (H y - y^2/2) + sum_n b_n sin(k_n y) cos(c k_n t),
    k_n = (n + 1/2) pi/H,  b_n = 2 g/(c^2 H k_n^3),

where y is the distance from the end that is held.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.materials import make_law, stiffness
from mpm_ref.scene import loads

G, RHO = 9.8, 1000.0
TERMS = 200             # of the series
HEAD = "dim = {dim}\ndx = {dx}\nend = {end}\ngravity = {gravity}\n{more}\n"
BODY = """
[[body]]
name = "{name}"
density = 1000.0
shape = {{ {shape} }}
sampling = {{ type = "regular", per_cell = 2 }}
material = {{ {material} }}
velocity = {{ {velocity} }}
"""
FLOOR = """
[[collider]]
name = "floor"
kind = "{kind}"
friction = {friction}
shape = {{ type = "half_space", point = {point}, normal = {normal} }}
"""
SOFT, STIFF = ('law = "fixed_corotated", E = 1e5, nu = 0.3',
               'law = "fixed_corotated", E = 1e6, nu = 0.3')
PLASTIC = 'law = "hencky", E = 1e6, nu = 0.3, flow = { type = "von_mises", sigma_y = 2e4 }'
SAND = 'law = "hencky", E = 1e6, nu = 0.3, flow = { type = "drucker_prager", friction_angle = 30 }'
WATER = 'law = "fluid", lam = 1e5'
RUBBER = 'law = "neo_hookean", E = 2e5, nu = 0.4'
TUNED = ("column", "flight", "spin", "bounce", "beam", "pair")


class AdviceScene(NamedTuple):
    """A scene, its quantities, and the function of its exact values, if it has a closed form.

    exact(t (T,), X (n, d)) returns {quantity: values (T, k)} at times t, of probes X.
    """

    name: str
    scene: object
    quantities: tuple
    exact: object = None


def head(dx, end, dim=2, gravity=(0.0, -G), more=""):
    """Return the top of a scene file."""
    return HEAD.format(dim=dim, dx=dx, end=end, gravity=list(gravity), more=more)


def solid(shape, material, name="body", velocity=""):
    """Return a body of a scene file."""
    return BODY.format(name=name, shape=shape, material=material, velocity=velocity)


def floor(point=(0.0, 0.0), normal=(0.0, 1.0), kind="separate", friction=0.0):
    """Return a half-space of a scene file."""
    return FLOOR.format(kind=kind, friction=friction, point=list(point), normal=list(normal))


def sides():
    """Return slip walls at both sides of a column."""
    return floor((0.0, 0.0), (1.0, 0.0), "slip") + floor((0.2, 0.0), (-1.0, 0.0), "slip")


def clamp(region):
    """Return a fixed region of a scene file."""
    return f'[[fixed]]\nname = "clamp"\nregion = {{ {region} }}\n'


def box(*corners):
    """Return a box as a shape of a scene file."""
    d = len(corners) // 2
    return f'type = "box", lower = {list(corners[:d])}, upper = {list(corners[d:])}'


def disk(x, y, r):
    """Return a disk as a shape of a scene file."""
    return f'type = "sphere", center = [{x}, {y}], radius = {r}'


def fly(t, X, radius=0.25):
    """Return the exact values in free flight of a disk about (0.5, 0.7)."""
    s = t[:, None, None]
    x = X + s * [1.0, 0.5] - 0.5 * s**2 * [0.0, G]
    mass = RHO * pi * radius**2
    return {"positions": x.reshape(len(t), -1), "front:x+": (0.5 + radius + t)[:, None],
            "kinetic": 0.5 * mass * (1.0 + (0.5 - G * t) ** 2)[:, None]}


def toss(t, X):
    """Return the exact values in free flight of a box of 0.4 x 0.3 x 0.3 m."""
    s = t[:, None, None]
    x = X + s * [2.0, 0.0, 3.0] - 0.5 * s**2 * [0.0, 0.0, G]
    mass = RHO * 0.4 * 0.3 * 0.3
    return {"positions": x.reshape(len(t), -1), "front:x+": (0.4 + 2.0 * t)[:, None],
            "kinetic": 0.5 * mass * (4.0 + (3.0 - G * t) ** 2)[:, None]}


def hang(t, X, H=0.6):
    """Return the exact values of the hanging column."""
    def at(X):
        mirrored = X * [1.0, -1.0] + [0.0, H]
        u = column_positions(t, mirrored, H=H) - mirrored
        return X + u
    return {"positions": at(X).reshape(len(t), -1),
            "front:y-": at(np.array([[0.0, 0.0]]))[..., 1]}


def release(t, X, H=0.8):
    """Return the exact values of the released column."""
    x = column_positions(t, X)
    top = column_positions(t, np.array([[0.0, H]]))[..., 1]
    return {"positions": x.reshape(len(t), -1), "front:y+": top}


def column_positions(t, X, E=1e6, H=0.8):
    """Return the positions (T, n, 2) of points X of the released column."""
    c = sqrt(stiffness(make_law("fixed_corotated", E=E, nu=0.3)) / RHO)
    k = (np.arange(TERMS) + 0.5) * pi / H
    b = 2.0 * G / (c**2 * H * k**3)
    y = X[:, 1]
    wave = np.einsum("n,ny,tn->ty", b, np.sin(k[:, None] * y), np.cos(c * np.outer(t, k)))
    u = wave - G / c**2 * (H * y - 0.5 * y**2)
    x = np.repeat(X[None], len(t), axis=0)
    x[..., 1] += u
    return x


def advice_scenes():
    """Return all `AdviceScene`s."""
    texts = (texts_of_choice() | texts_with_closed_forms() | texts_of_solids()
             | texts_of_flow())
    return [AdviceScene(name, loads(text, name),
                        ("positions", front, "kinetic", "centroid", "elastic"), exact)
            for name, (text, front, exact) in texts.items()]


def texts_of_choice():
    """Return {name: (text, front, exact values)} of the scenes in `TUNED`."""
    return {
        "column": (head(0.05, 0.08) + solid(box(0.0, 0.0, 0.2, 0.8), STIFF) + sides()
                   + floor(kind="sticky"), "front:y+", release),
        "flight": (head(0.1, 0.2) + solid(disk(0.5, 0.7, 0.25), SOFT,
                                          velocity="linear = [1.0, 0.5]"), "front:x+", fly),
        "spin": (head(0.05, 0.15, gravity=(0.0, 0.0)) + solid(
            disk(0.5, 0.5, 0.2), SOFT, velocity="angular = 20.0"), "front:x+", None),
        "bounce": (head(0.05, 0.12) + solid(disk(0.3, 0.21, 0.2), STIFF,
                                            velocity="linear = [0.0, -2.0]") + floor(),
                   "front:y-", None),
        "beam": (head(0.05, 0.3, gravity=(0.0, -4.0)) + solid(
            box(-0.1, 0.0, 0.8, 0.2), STIFF) + clamp(box(-0.2, -0.1, 0.0, 0.3)), "front:y-", None),
        "pair": (head(0.05, 0.12, gravity=(0.0, 0.0)) + solid(
            disk(0.2, 0.3, 0.15), SOFT, "left", "linear = [2.0, 0.0]") + solid(
            disk(0.6, 0.3, 0.15), SOFT, "right", "linear = [-2.0, 0.0]"), "front:x-", None),
    }


def texts_with_closed_forms():
    """Return {name: (text, front, exact values)} of other scenes with a closed form."""
    return {
        "toss": (head(0.1, 0.25, 3, (0.0, 0.0, -G)) + solid(
            box(0.0, 0.0, 0.0, 0.4, 0.3, 0.3), RUBBER, velocity="linear = [2.0, 0.0, 3.0]"),
            "front:x+", toss),
        "hang": (head(0.05, 0.06) + solid(box(0.0, 0.0, 0.2, 0.6), STIFF) + sides()
                 + floor((0.0, 0.6), (0.0, -1.0), "sticky"), "front:y-", hang),
    }


def texts_of_solids():
    """Return {name: (text, front, None)} of elastic bodies."""
    return {
        "slide": (head(0.05, 0.3, gravity=(3.0, -G)) + solid(
            box(0.0, 0.0, 0.4, 0.2), STIFF) + floor(friction=0.2), "front:x+", None),
        "stick": (head(0.05, 0.1, gravity=(0.0, -G)) + solid(
            box(0.0, 0.0, 0.4, 0.2), SOFT, velocity="linear = [1.0, 0.0]") + floor(friction=0.5),
            "front:x+", None),
        "cube": (head(0.1, 0.1, 3, (0.0, 0.0, -G)) + solid(
            box(0.0, 0.0, 0.0, 0.4, 0.4, 0.4), SOFT, velocity="linear = [0.0, 0.0, -1.0]")
            + floor((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "front:z+", None),
        "roll": (head(0.05, 0.25, gravity=(3.0, -9.0)) + solid(disk(0.2, 0.2, 0.2), STIFF)
                 + floor(friction=0.6), "front:x+", None),
        "swing": (head(0.05, 0.25, gravity=(0.0, 0.0)) + solid(
            box(-0.1, 0.0, 0.6, 0.15), RUBBER, velocity="linear = [0.0, 1.5]") + clamp(
                box(-0.2, -0.1, 0.0, 0.25)), "front:y+", None),
        "lean": (head(0.05, 0.25, gravity=(4.0, -G)) + solid(box(0.0, 0.0, 0.2, 0.6), SOFT)
                 + floor(kind="sticky"), "front:x+", None),
        "shove": (head(0.05, 0.15, gravity=(0.0, 0.0)) + solid(
            box(0.0, 0.0, 0.3, 0.2), STIFF, "first", "linear = [2.0, 0.0]") + solid(
                box(0.35, 0.0, 0.65, 0.2), SOFT, "second"), "front:x+", None),
        "spin3": (head(0.1, 0.1, 3, (0.0, 0.0, 0.0)) + solid(
            box(0.0, 0.0, 0.0, 0.5, 0.4, 0.3), RUBBER, velocity="angular = [0.0, 2.0, 10.0]"),
            "front:x+", None),
        "tower": (head(0.1, 0.1, 3, (2.0, 0.0, -G)) + solid(
            box(0.0, 0.0, 0.0, 0.3, 0.3, 0.6), SOFT) + floor(
                (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "sticky"), "front:z+", None),
        "damped": (head(0.05, 0.12, more='integrator = "hot-plus"\nlongest = 0.005') + solid(
            disk(0.3, 0.21, 0.2), SOFT, velocity="linear = [0.0, -2.0]") + floor(),
            "front:y-", None),
    }


def texts_of_flow():
    """Return {name: (text, front, None)} of water, sand and metal."""
    return {
        "dam": (head(0.02, 0.12) + solid(box(0.0, 0.0, 0.1, 0.2), WATER) + floor(kind="slip")
                + floor((0.0, 0.0), (1.0, 0.0), "slip"), "front:x+", None),
        "sand": (head(0.02, 0.15) + solid(box(0.0, 0.0, 0.2, 0.2), SAND) + floor(friction=0.5)
                 + floor((0.0, 0.0), (1.0, 0.0), "slip"), "front:x+", None),
        "impact": (head(0.05, 0.08) + solid(box(0.0, 0.0, 0.3, 0.6), PLASTIC,
                                            velocity="linear = [0.0, -4.0]") + floor(),
                   "front:y+", None),
        "splash": (head(0.02, 0.1) + solid(disk(0.2, 0.1, 0.1), WATER,
                                           velocity="linear = [0.0, -1.0]")
                   + floor(kind="slip"), "front:x+", None),
        "forge": (head(0.05, 0.06) + solid(box(0.0, 0.0, 0.4, 0.3), PLASTIC) + floor(
            friction=0.3) + solid(
                box(0.05, 0.3, 0.35, 0.5), STIFF, "hammer", "linear = [0.0, -5.0]"),
            "front:x+:body", None),
        "slope": (head(0.02, 0.15, gravity=(6.0, -8.0)) + solid(box(0.0, 0.0, 0.2, 0.1), SAND)
                  + floor(friction=0.6), "front:x+", None),
    }
