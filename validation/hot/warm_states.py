"""HOT's scenes in the middle of their motion: states from which steps are measured, on disk.

A scene runs by HOT until its contact, pull or yield has begun. The state then reached depends on
the scene and on the code alone, so it is computed once for each version of the package and stored
as a checkpoint in the user's cache; experiments share it. Where there is no place to store it, it
is computed again.
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
    length_of_step,
    show,
    simulate,
    update_bound,
)
from mpm_ref.store.checkpoint import BadCheckpoint, load, save
from mpm_ref.store.manifest import scene_hash, source_hash

from ..common.scenes import with_
from .one_step import implicit_step
from .sizes import sized

SOFT_CAT = 1e6          # Young's modulus (Table 2) [Pa]
START_TIMES = {         # time at which a scene is in the middle of its motion [s]
    "twist": 0.5,
    "boxes": 0.3,
    "donut": 0.4,
    "armacat_soft": 0.6,
    "armacat_stiff": 0.6,
    "chain": 1.0,
    "boards": 0.3,
    "wheel": 0.3,
    "faceless": 1.0,
    "sauce": 0.6,
    "aluminium": 0.004,
}
PRINTED = tuple(name for name in START_TIMES if name != "aluminium")  # in Table 3 and Figure 15
QUICK = ("boxes", "wheel", "faceless", "sauce")     # whose states are reached quickly
VERSIONS = 4            # of the package whose states stay on disk


def scene(name, profile):
    """Return a scene of `START_TIMES` at a size, with HOT as its integrator."""
    record = sized(f"hot_{catalogue_name(name)}", profile, integrator="hot", unstable="allow")
    if name != "armacat_soft":
        return record
    return with_(record, body=tuple(
        with_(body, material=with_(body.material, E=SOFT_CAT)) if body.name == "cat" else body
        for body in record.body))


def catalogue_name(name):
    """Return the name of a scene of `START_TIMES` without its stiffness, as of `sizes.SIZES`."""
    return name.removesuffix("_soft").removesuffix("_stiff")


def warm_state(name, profile, t=None):
    """Return the `Problem` and the `State` of a scene at its time in `START_TIMES`, or at t [s].

    The state is read if it is stored.
    """
    problem, t = build(scene(name, profile)), START_TIMES[name] if t is None else t
    path = cache_folder() / f"{name}-{scene_hash(problem)[:16]}-{t:g}s.h5"
    try:
        return problem, load(path, problem)[0]
    except (BadCheckpoint, OSError):
        state = march_to(problem, t)
    try:
        save(path, state, problem)
    except OSError:
        pass                    # no place to store it: it is computed again
    return problem, state


def march_to(problem, t):
    """Return the `State` of a problem after the first step that reaches the time t [s].

    Raises ValueError if the scene ends before.
    """
    state, stepper = next(simulate(problem)).state, problem.stepper()
    while state.t < t and not ended(problem.clock, state):
        take_step(problem, stepper, state)
    if state.t < t:
        raise ValueError(f"{problem.title}: it ends at {state.t:g} s, before {t:g} s")
    return state


def take_step(problem, stepper, state):
    """Advance by a step; a frame that is due is counted, since steps are cut to meet the next."""
    advance(problem, stepper, state)
    if frame_is_due(problem.clock, state):
        show(state, 0.0)


def following_steps(problem, state, count):
    """Yield the next `count` `ImplicitStep`s of a state.

    Each is valid until the next is asked for: the problem's own method then takes it.
    """
    stepper = problem.stepper()
    for _ in range(count):
        yield implicit_step(stepper, state, next_step_length(problem, stepper, state))
        take_step(problem, stepper, state)


def next_step_length(problem, stepper, state):
    """Return the length of the next step of `simulate.advance` [s]; sort particles as it does."""
    if state.step % SORT == 0:
        stepper.sort(state.bodies)
    if bound_is_due(problem.clock, state):
        update_bound(problem, stepper, state)
    return length_of_step(problem, stepper, state)


def cache_folder(root=None):
    """Return the folder of this version's states in the user's cache; remove old versions."""
    root = Path(root or platformdirs.user_cache_dir("mpm_ref")) / "warm_states"
    current = root / source_hash()[:16]
    try:
        current.mkdir(parents=True, exist_ok=True)
        os.utime(current)
        others = [d for d in root.iterdir() if d.is_dir() and d != current]
        for old in sorted(others, key=lambda d: d.stat().st_mtime)[:1 - VERSIONS]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:
        pass                    # `warm_state` then computes the state and stores nothing
    return current
