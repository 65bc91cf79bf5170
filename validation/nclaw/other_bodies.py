"""What NCLaw's Figures 3, 4, 7 and 8 show: laws in bodies, numbers and company that they were not
trained in.
"""

from functools import partial
from math import isfinite

import numpy as np

from mpm_ref.materials import DruckerPrager, FixedCorotated, Fluid, Hencky, VonMises
from mpm_ref.nclaw.bodies import body_maker, body_with_laws, copy_body
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import threads_for, with_
from ..common.weights_needed import Untrained
from ..ldm.published_bodies import keep
from .environments import ENVIRONMENTS, environment
from .gallery import cone, contact, large, pool
from .melting import melting
from .stand_in_bodies import said
from .states import BROKEN, DISTANCE, shots
from .tasks import TOYS, geometry
from .trained_laws import trained, weights_of

EACH = 4000         # kept points of a run, at most
OF = {(FixedCorotated, None): "jelly", (Hencky, DruckerPrager): "sand",
      (Hencky, VonMises): "plasticine", (Fluid, None): "water"}
WORDS = ("ours",)                   # what stands beside the truth; methods of `nets.weights_of`
MELTS = ("plasticine", "sand")      # before and after


@experiment("nclaw.fig3", title="NCLaw: a million points, and four toys",
            profiles=("standard", "paper"), budget={"standard": 900, "paper": 50000})
def many(run):
    """Keeps points at the start and at the end. The dragon's run is cut to 100 of 10 000 steps at
    the standard profile.
    """
    dragon = with_(large(), steps=run.choose(standard=100, paper=10000))
    show(run, {"toys": (partial(both, contact()), "bodies that meet"),
               "dragon": (partial(both, dragon), said("dragon"))})


@experiment("nclaw.fig4", title="NCLaw: a duck on water, and ice cream that melts",
            profiles=("standard",), budget={"standard": 2400})
def company(run):
    """Keeps points at the start and at the end, of laws that share a grid."""
    show(run, {"pool": (partial(both, pool()), f"{said('bob')} on water"),
               "melting": (partial(melted, cone()), f"{said('icecream')}, plasticine to sand")})


@experiment("nclaw.fig7", title="NCLaw: other bodies, Figures 7 and 8",
            profiles=("standard",), budget={"standard": 2200})
def bodies(run):
    """Keeps points of task (c) at the start and half-way; graph networks are for smaller bodies."""
    halves = {name: with_(geometry(name), steps=geometry(name).steps // 2)
              for name in ENVIRONMENTS}
    show(run, {name: (partial(both, half, ("ours", "neural")), said(TOYS[name].name))
               for name, half in halves.items()})


def show(run, parts):
    """Keep, and record the distance at the end of, runs of true laws and of others: of each part
    {name: (what makes it, words)}. Those whose laws are not trained yet are told.
    """
    kept = {}
    for name, (make, words) in run.progress(parts.items(), "runs"):
        try:
            found = run.cached(name, make)
        except Untrained as fault:
            run.note(f"{name}: {fault}")
            continue
        kept |= {f"{name}_{word}": x for word, x in found["x"].items()}
        for word, off in found["off"].items():
            apart = f"{DISTANCE}; their middles are {found['middle'][word]:.3g} m apart"
            run.record(f"{run.experiment.id}.{name}.{word}", off, unit="m^2", comparator="info",
                       scale=f"{found['points']} particles, {found['steps']} steps, {words}",
                       note=apart if isfinite(off) else BROKEN)
    keep(run, **kept)


def both(scene, words=WORDS):
    """`thinned` runs of a scene with true laws and with those of some words. Raises `Untrained`."""
    ends = with_(scene, every=scene.steps)
    names = {of(body) for body in build(scene).bodies}
    laws = {word: {name: body_maker(trained(weights_of(word, name))) for name in names}
            for word in words}
    runs = {"true": shots(ends, copy_body)}
    for word, mine in laws.items():
        runs[word] = shots(ends, lambda body, mine=mine: mine[of(body)](body))
    return thinned(runs, scene.steps)


def melted(scene):
    """`thinned` runs of a scene whose plasticine becomes sand. Raises `Untrained`."""
    ends = with_(scene, every=scene.steps)
    ours = [body_maker(trained(name)) for name in MELTS]
    true = [partial(of_laws, build(environment(name)).bodies[0]) for name in MELTS]
    with threads_for(build(scene).bodies):
        runs = {word: np.array([*melting(build(ends), *laws)])
                for word, laws in (("true", true), ("ours", ours))}
    return thinned(runs, scene.steps)


def thinned(runs, steps):
    """Plain values: of runs {word: (frames, n, 3)}, at most `EACH` points each; how far others end
    from the true one, point by point [m^2] and in their middles [m].
    """
    n, last = runs["true"].shape[1], {word: x[-1] for word, x in runs.items()}
    true = last.pop("true")
    middle = {word: x.mean(axis=0) - true.mean(axis=0) for word, x in last.items()}
    return {"x": {word: x[:, ::-(-n // EACH)].round(5).tolist() for word, x in runs.items()},
            "points": n, "steps": steps,
            "off": {word: float(np.mean((x - true) ** 2)) for word, x in last.items()},
            "middle": {word: float(np.linalg.norm(gap)) for word, gap in middle.items()}}


def of(body):
    """The environment whose material a body is of."""
    return next(name for (law, flow), name in OF.items() if isinstance(body.law, law)
                and (flow is None or isinstance(body.flow, flow)))


def of_laws(other, body):
    """A body of the laws of another."""
    return body_with_laws(body, other.law, other.flow)
