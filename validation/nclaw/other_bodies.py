"""Runs of laws in other bodies and scenes than in training: NCLaw's Figures 3, 4, 7 and 8, and task
(d), an inclined plane (Figure 2d).

At the standard profile scenes have fewer points than at the profile `paper`, whose sizes are those
of the release; steps are as many, but for the pool's. Records name the bodies.
"""

from functools import partial
from itertools import pairwise
from math import isfinite

import numpy as np

from mpm_ref.materials import DruckerPrager, FixedCorotated, Fluid, Hencky, VonMises
from mpm_ref.nclaw.bodies import body_maker, body_with_laws, copy_body
from mpm_ref.scene import Poisson, build

from ..common.registry import experiment
from ..common.scenes import threads_for, with_
from ..common.weights_needed import Untrained
from ..ldm.published_bodies import keep
from .environments import ENVIRONMENTS, environment
from .gallery import CORNERS, DESSERT, TOY_POINTS, contact, dessert, halved, large, pool
from .melting import melting
from .stand_in_bodies import body_label
from .states import BROKEN, DISTANCE, collect, shots
from .tasks import TOYS, geometry, slope
from .trained_laws import trained, weights_of

EACH = 4000         # kept points of a run, at most
ENVIRONMENT_OF = {(FixedCorotated, None): "jelly", (Hencky, DruckerPrager): "sand",
                  (Hencky, VonMises): "plasticine", (Fluid, None): "water"}
METHODS = ("ours", "admissible")    # compared with the true laws; of `trained_laws.weights_of`
BASELINE_METHODS = ("ours", "neural", "admissible")     # of task (c)
FEW, SHORT = 1000, 550              # points and steps of the slope, quick: until the floor
FEW_ON_SLOPE = 1500                 # points, standard: about fifteen per cell
FEW_IN_TOY = 1000                   # points of each toy, standard
SPARSE = 0.0115                     # [m], between points of the dragon, standard; before `halved`
SHORT_POOL = 1500                   # steps, standard
MELTS = ("plasticine", "sand")      # before and after


@experiment("nclaw.fig3", title="NCLaw: a million points, and four toys",
            profiles=("standard", "paper"), budget={"standard": 900, "paper": 50000})
def many(run):
    """Keeps points at the start and at the end. At the standard profile the dragon has thousands of
    points, not a million, on a coarser grid, for as many steps.
    """
    dragon = large() if run.profile == "paper" else halved(large(SPARSE))
    toys = contact(run.choose(standard=FEW_IN_TOY, paper=TOY_POINTS))
    show(run, {"contact": (partial(both, toys), labels(CORNERS)),
               "dragon": (partial(both, dragon), body_label("dragon"))})


@experiment("nclaw.fig4", title="NCLaw: a duck on water, and ice cream that melts",
            profiles=("standard", "paper"), budget={"standard": 1200, "paper": 6000})
def company(run):
    """Keeps points at the start and at the end, of laws that share a grid."""
    scenes = {"pool": pool(), "melting": dessert()}
    if run.profile == "standard":
        scenes = {name: halved(scene) for name, scene in scenes.items()}
        scenes["pool"] = with_(scenes["pool"], steps=SHORT_POOL)
    show(run, {"pool": (partial(both, scenes["pool"]), f"{body_label('bob')} on water"),
               "melting": (partial(melted, scenes["melting"]),
                           f"{labels(DESSERT)}, plasticine to sand")})


@experiment("nclaw.fig7", title="NCLaw: other bodies, Figures 7 and 8",
            profiles=("standard", "paper"), budget={"standard": 800, "paper": 4000})
def bodies(run):
    """Keeps points of task (c) at the start and half-way; graph networks are for smaller bodies."""
    share = run.choose(standard=8, paper=1)
    halves = {name: with_(with_points(geometry(name), TOYS[name].points // share),
                          steps=geometry(name).steps // 2) for name in ENVIRONMENTS}
    show(run, {name: (partial(both, half, BASELINE_METHODS), body_label(TOYS[name].name))
               for name, half in halves.items()})


@experiment("nclaw.slope", title="NCLaw: an inclined plane, task (d)",
            profiles=("quick", "standard", "paper"),
            budget={"quick": 25, "standard": 800, "paper": 4000})
def inclined(run):
    """Keep points at the start and at the end, of water and of the other materials with its
    density, with true laws, ours, and those that thermodynamics admits; the paper has water alone.
    """
    names = run.choose(quick=("water",), standard=ENVIRONMENTS)
    show(run, {name: (partial(both, sized(run, slope_of(name))), body_label("dragon30"))
               for name in names})


def show(run, parts):
    """Keep the points of runs with true laws and with others, and record their distance at the end,
    for parts {name: (function that makes the runs, label)}; note those whose laws are not trained
    yet.
    """
    points = {}
    for name, (make, label) in run.progress(parts.items(), "runs"):
        try:
            result = run.cached(f"{name}: {label}", make)
        except Untrained as fault:
            run.note(f"{name}: {fault}")
            continue
        points |= {f"{name}_{word}": x for word, x in result["x"].items()}
        for word, parts_off in result["off"].items():
            for part, (off, middle) in parts_off.items():
                note = f"{DISTANCE}; their middles are {middle:.3g} m apart"
                count, of = result["points"][part], f" of {part}" if part else ""
                target = ".".join((run.experiment.id, name, word, *filter(None, [part])))
                run.record(target, off, unit="m^2", comparator="info",
                           scale=f"{count} particles{of}, {result['steps']} steps, {label}",
                           note=note if isfinite(off) else broken_note(result["ended"]))
    keep(run, **points)


def labels(names):
    """Return bodies in words."""
    return ", ".join(map(body_label, names))


def broken_note(ended):
    """Return the note on runs {word: why it broke down}."""
    return "; ".join([BROKEN, *(f"{word}: {why}" for word, why in ended.items())])


def both(scene, methods=METHODS):
    """Return the `thinned` runs of a scene with true laws and with methods. Raises `Untrained`."""
    ends = with_(scene, every=scene.steps)
    names = {environment_of(body) for body in build(scene).bodies}
    laws = {word: {name: body_maker(trained(weights_of(word, name))) for name in names}
            for word in methods}
    runs = {"true": shots(ends, copy_body)}
    for word, mine in laws.items():
        runs[word] = shots(ends, lambda body, mine=mine: mine[environment_of(body)](body))
    return thinned(runs, scene)


def melted(scene):
    """Return the `thinned` runs of a scene whose plasticine becomes sand. Raises `Untrained`."""
    ends = with_(scene, every=scene.steps)
    laws = {"true": [partial(with_laws_of, build(environment(name)).bodies[0]) for name in MELTS],
            **{word: [body_maker(trained(weights_of(word, name))) for name in MELTS]
               for word in METHODS}}
    with threads_for(build(scene).bodies):
        runs = {word: collect(melting(build(ends), *pair), 2) for word, pair in laws.items()}
    return thinned(runs, scene)


def thinned(runs, scene):
    """Return plain values of a scene's runs {word: `Shots`}: at most `EACH` points of each; the
    `distances` of their ends from the true one, of all points and of each of several bodies; and
    why runs broke down.
    """
    true, parts = runs["true"].x[-1], body_parts(scene)
    return {"x": {word: run.x[:, ::-(-len(true) // EACH)].round(5).tolist()
                  for word, run in runs.items()},
            "points": {name: len(true[part]) for name, part in parts.items()},
            "steps": scene.steps,
            "off": {word: {name: distances(run.x[-1, part], true[part])
                           for name, part in parts.items()}
                    for word, run in runs.items() if word != "true"},
            "ended": {word: str(run.end) for word, run in runs.items() if run.end}}


def body_parts(scene):
    """Return {name: slice} of the points of a scene: "" of all, and of each body of several."""
    bodies = build(scene).bodies
    first = np.cumsum([0, *(len(body.id) for body in bodies)]).tolist()
    each = {body.name: slice(*ends) for body, ends in zip(bodies, pairwise(first), strict=True)}
    return {"": slice(None), **(each if len(bodies) > 1 else {})}


def distances(x, true):
    """Return the mean squared distance along an axis of points (n, 3) from the true ones [m^2], and
    the distance of their middles [m].
    """
    gap = x.mean(axis=0) - true.mean(axis=0)
    return [float(np.mean((x - true) ** 2)), float(np.linalg.norm(gap))]


def environment_of(body):
    """Return the environment that has the material of a body."""
    return next(name for (law, flow), name in ENVIRONMENT_OF.items() if isinstance(body.law, law)
                and (flow is None or isinstance(body.flow, flow)))


def with_laws_of(other, body):
    """Return a body with the laws of another."""
    return body_with_laws(body, other.law, other.flow)


def slope_of(name):
    """Return the scene of task (d) with an environment's material."""
    scene, material = slope(), environment(name).body[0].material
    return with_(scene, body=(with_(scene.body[0], name=name, material=material),))


def sized(run, scene):
    """Return a scene, of few points and at quick of few steps, but for the profile `paper`."""
    return run.choose(quick=with_points(with_(scene, steps=SHORT), FEW),
                      standard=with_points(scene, FEW_ON_SLOPE), paper=scene)


def with_points(scene, count):
    """Return a scene whose one body has so many points."""
    return with_(scene, body=(with_(scene.body[0], sampling=Poisson(count=count)),))
