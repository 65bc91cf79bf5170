"""Runs of laws in other bodies and scenes than in training: NCLaw's Figures 3, 4, 7 and 8, and task
(d), an inclined plane (Figure 2d).
"""

from functools import partial
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
from .gallery import cone, contact, large, pool
from .melting import melting
from .stand_in_bodies import body_label
from .states import BROKEN, DISTANCE, shots
from .tasks import TOYS, geometry, slope
from .trained_laws import trained, weights_of

EACH = 4000         # kept points of a run, at most
ENVIRONMENT_OF = {(FixedCorotated, None): "jelly", (Hencky, DruckerPrager): "sand",
                  (Hencky, VonMises): "plasticine", (Fluid, None): "water"}
METHODS = ("ours",)                 # compared with the true laws; of `trained_laws.weights_of`
SLOPE_METHODS = ("ours", "admissible")
FEW, SHORT = 1000, 550              # points and steps of the slope, quick: until the floor
MELTS = ("plasticine", "sand")      # before and after


@experiment("nclaw.fig3", title="NCLaw: a million points, and four toys",
            profiles=("standard", "paper"), budget={"standard": 900, "paper": 50000})
def many(run):
    """Keeps points at the start and at the end. The dragon's run is cut to 100 of 10 000 steps at
    the standard profile.
    """
    dragon = with_(large(), steps=run.choose(standard=100, paper=10000))
    show(run, {"toys": (partial(both, contact()), "bodies that meet"),
               "dragon": (partial(both, dragon), body_label("dragon"))})


@experiment("nclaw.fig4", title="NCLaw: a duck on water, and ice cream that melts",
            profiles=("standard",), budget={"standard": 2400})
def company(run):
    """Keeps points at the start and at the end, of laws that share a grid."""
    show(run, {"pool": (partial(both, pool()), f"{body_label('bob')} on water"),
               "melting": (partial(melted, cone()),
                           f"{body_label('icecream')}, plasticine to sand")})


@experiment("nclaw.fig7", title="NCLaw: other bodies, Figures 7 and 8",
            profiles=("standard",), budget={"standard": 2200})
def bodies(run):
    """Keeps points of task (c) at the start and half-way; graph networks are for smaller bodies."""
    halves = {name: with_(geometry(name), steps=geometry(name).steps // 2)
              for name in ENVIRONMENTS}
    show(run, {name: (partial(both, half, ("ours", "neural")), body_label(TOYS[name].name))
               for name, half in halves.items()})


@experiment("nclaw.slope", title="NCLaw: an inclined plane, task (d)",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 2400})
def inclined(run):
    """Keep points at the start and at the end, of water and of the other materials with its
    density, with true laws, ours, and those that thermodynamics admits; the paper has water alone.
    """
    names = run.choose(quick=("water",), standard=ENVIRONMENTS)
    show(run, {name: (partial(both, sized(run, slope_of(name)), SLOPE_METHODS),
                      body_label("dragon")) for name in names})


def show(run, parts):
    """Keep the points of runs with true laws and with others, and record their distance at the end,
    for parts {name: (function that makes the runs, label)}; note those whose laws are not trained
    yet.
    """
    points = {}
    for name, (make, label) in run.progress(parts.items(), "runs"):
        try:
            result = run.cached(name, make)
        except Untrained as fault:
            run.note(f"{name}: {fault}")
            continue
        points |= {f"{name}_{word}": x for word, x in result["x"].items()}
        for word, off in result["off"].items():
            note = f"{DISTANCE}; their middles are {result['middle'][word]:.3g} m apart"
            run.record(f"{run.experiment.id}.{name}.{word}", off, unit="m^2", comparator="info",
                       scale=f"{result['points']} particles, {result['steps']} steps, {label}",
                       note=note if isfinite(off) else BROKEN)
    keep(run, **points)


def both(scene, methods=METHODS):
    """Return the `thinned` runs of a scene with true laws and with methods. Raises `Untrained`."""
    ends = with_(scene, every=scene.steps)
    names = {environment_of(body) for body in build(scene).bodies}
    laws = {word: {name: body_maker(trained(weights_of(word, name))) for name in names}
            for word in methods}
    runs = {"true": shots(ends, copy_body)}
    for word, mine in laws.items():
        runs[word] = shots(ends, lambda body, mine=mine: mine[environment_of(body)](body))
    return thinned(runs, scene.steps)


def melted(scene):
    """Return the `thinned` runs of a scene whose plasticine becomes sand. Raises `Untrained`."""
    ends = with_(scene, every=scene.steps)
    ours = [body_maker(trained(name)) for name in MELTS]
    true = [partial(with_laws_of, build(environment(name)).bodies[0]) for name in MELTS]
    with threads_for(build(scene).bodies):
        runs = {word: np.array([*melting(build(ends), *laws)])
                for word, laws in (("true", true), ("ours", ours))}
    return thinned(runs, scene.steps)


def thinned(runs, steps):
    """Return plain values of runs {word: (frames, n, 3)}: at most `EACH` points of each; the
    distances of their ends from the true one, point by point [m^2] and of their middles [m].
    """
    n, last = runs["true"].shape[1], {word: x[-1] for word, x in runs.items()}
    true = last.pop("true")
    middle = {word: x.mean(axis=0) - true.mean(axis=0) for word, x in last.items()}
    return {"x": {word: x[:, ::-(-n // EACH)].round(5).tolist() for word, x in runs.items()},
            "points": n, "steps": steps,
            "off": {word: float(np.mean((x - true) ** 2)) for word, x in last.items()},
            "middle": {word: float(np.linalg.norm(gap)) for word, gap in middle.items()}}


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
    """Return a scene, at quick of few points and steps."""
    few = with_(scene.body[0], sampling=Poisson(count=FEW))
    return run.choose(quick=with_(scene, steps=SHORT, body=(few,)), standard=scene)
