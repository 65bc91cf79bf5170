"""HOT's scenes in the middle of things: the states that steps are measured from, kept on disk.

A scene runs by HOT until what it is about has begun: a contact, a pull, a yield. The state then
reached depends on the scene and on the code alone, so it is marched to once for each version of
the package and kept as a checkpoint in the user's cache; experiments share it. Where there is no
place to keep it, it is marched to again.
"""

import os
import shutil
from pathlib import Path

import platformdirs

from mpm_ref.scene import build
from mpm_ref.simulate import (
    SORT,
    advance,
    bound_is_due,
    ended,
    frame_is_due,
    next_dt,
    show,
    simulate,
    swiftest,
    update_bound,
)
from mpm_ref.store.checkpoint import BadCheckpoint, load, save
from mpm_ref.store.manifest import scene_hash, source_hash

from ..common.scenes import with_
from .one_step import Step
from .sizes import sized

SOFT_CAT = 1e6          # Young's modulus (Table 2) [Pa]
BEGUN = {               # time at which a scene is in the middle of things [s]
    "twist": 0.5,
    "boxes": 0.3,
    "donut": 0.4,
    "armacat_soft": 0.6,
    "armacat_stiff": 0.6,
    "chain": 1.0,
    "boards": 0.3,
    "wheel": 0.3,
    "faceless": 1.0,
    "sauce": 0.3,
    "aluminium": 0.004,
}
PRINTED = tuple(name for name in BEGUN if name != "aluminium")  # in Table 3 and Figure 15
QUICK = ("boxes", "wheel", "faceless", "sauce")     # where little has to run before
KEPT = 4                # versions of the package whose states stay on disk


def scene(name, profile):
    """A scene of `BEGUN` at a size, marched by HOT."""
    soft = name == "armacat_soft"
    made = sized("hot_" + name.removesuffix("_soft").removesuffix("_stiff"), profile,
                 integrator="hot", unstable="allow")
    if not soft:
        return made
    return with_(made, body=tuple(
        with_(body, material=with_(body.material, E=SOFT_CAT)) if body.name == "cat" else body
        for body in made.body))


def begun(name, profile, t=None):
    """(`Problem`, `State`) of a scene at its time in `BEGUN` or at another [s], read where it has
    been kept.
    """
    problem, t = build(scene(name, profile)), BEGUN[name] if t is None else t
    path = folder() / f"{name}-{scene_hash(problem)[:16]}-{t:g}s.h5"
    try:
        return problem, load(path, problem)[0]
    except (BadCheckpoint, OSError):
        state = marched(problem, t)
    try:
        save(path, state, problem)
    except OSError:
        pass                    # no place for it: the next one marches again
    return problem, state


def marched(problem, t):
    """The `State` of a problem after the first step that reaches the time t [s].

    Raises ValueError where the scene ends before.
    """
    state, stepper = next(simulate(problem)).state, problem.stepper()
    while state.t < t and not ended(problem.clock, state):
        onward(problem, stepper, state)
    if state.t < t:
        raise ValueError(f"{problem.title}: it ends at {state.t:g} s, before {t:g} s")
    return state


def onward(problem, stepper, state):
    """One step of a run; a frame that is due is counted, since steps are cut to meet the next."""
    advance(problem, stepper, state)
    if frame_is_due(problem.clock, state):
        show(state, 0.0)


def steps(problem, state, count):
    """The next so many `Step`s of a state. Each holds until the next is asked for: the problem's
    own method then makes it.
    """
    stepper = problem.stepper()
    for _ in range(count):
        dt = coming(problem, stepper, state)
        yield Step(state.bodies, stepper, stepper.problem(state.bodies, state.t, dt), dt, state.t)
        onward(problem, stepper, state)


def coming(problem, stepper, state):
    """Length of the step that `simulate.advance` will make [s], particles sorted as it will."""
    if state.step % SORT == 0:
        stepper.sort(state.bodies)
    if bound_is_due(problem.clock, state):
        update_bound(problem, stepper, state)
    return next_dt(problem.clock, state, swiftest(problem, stepper, state))


def particles(problem):
    """Number of particles of a problem."""
    return sum(len(body.id) for body in problem.bodies)


def folder(root=None):
    """Folder of this version's states, in the user's cache; those of older versions but a few are
    removed.
    """
    root = Path(root or platformdirs.user_cache_dir("mpm_ref")) / "begun"
    here = root / source_hash()[:16]
    try:
        here.mkdir(parents=True, exist_ok=True)
        os.utime(here)
        others = [d for d in root.iterdir() if d.is_dir() and d != here]
        for old in sorted(others, key=lambda d: d.stat().st_mtime)[:1 - KEPT]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:
        pass                    # `begun` finds nothing there and keeps nothing
    return here
