"""The catalogue of experiments: the decorator that declares one and the search for all."""

import importlib
from collections.abc import Callable
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any, NamedTuple

HERE = Path(__file__).parents[1]
GROUPS = {
    "verification": "Verification: analytic and manufactured solutions, published experiments",
    "independent": "Independent: second implementations in plain NumPy and SciPy",
    "trade": "Trade: error against cost",
    "extremes": "Extremes: where each method breaks",
    "hot": "HOT: hierarchical optimization time integration",
    "ldm": "LDM: model reduction on nonlinear manifolds",
    "ldmw": "LDM workshop: the first manifold model",
    "nclaw": "NCLaw: neural constitutive laws",
    "nsf": "NSF: neural stress fields",
}
PROFILES = ("quick", "standard", "paper")
BUDGETS = {"quick": 10.0, "standard": 600.0, "paper": 3600.0}     # where none is given [s]
NEAR, OFFERED = 0.6, 5      # likeness from which ids are offered for an unknown one, at most 5


class Experiment(NamedTuple):
    """One function that records numbers, with its title and budget."""

    id: str                         # "<group>.<name>", also the name of its result files
    title: str
    profiles: tuple[str, ...]       # at which it can run
    budget: dict[str, float]        # expected wall seconds on two cores, per profile
    function: Callable[[Any], None]

    def seconds(self, profile):
        """Return the expected wall seconds at a profile."""
        return self.budget.get(profile, BUDGETS[profile])


def experiment(experiment_id, *, title, profiles=PROFILES, budget=None):
    """Declare the decorated function `f(run)` to be the experiment of that id.

    Raises ValueError for a group or a profile that does not exist.
    """
    _check_names(experiment_id, (*profiles, *(budget or {})))

    def declare(function):
        function.experiment = Experiment(
            experiment_id, title, tuple(profiles), dict(budget or {}), function)
        return function

    return declare


def _check_names(id, profiles):
    group, _, name = id.partition(".")
    if group not in GROUPS or not name:
        raise ValueError(f"experiment id {id!r}: expected <group>.<name>; groups are {[*GROUPS]}")
    for profile in profiles:
        if profile not in PROFILES:
            raise ValueError(f"{id}: unknown profile {profile!r}; there are {', '.join(PROFILES)}")


class Catalogue(NamedTuple):
    """All experiments by id, in order of group and file; and the modules that failed to load."""

    experiments: dict[str, Experiment]
    broken: dict[str, Exception]


def discover(root=HERE):
    """Import every module under ``<root>/<group>/`` and collect the experiments declared there.

    One module that cannot be imported does not hide the others: it is listed as broken.
    """
    experiments, broken = {}, {}
    for group in GROUPS:
        for file in sorted((root / group).rglob("*.py")):
            name = ".".join((root.name, *file.relative_to(root).with_suffix("").parts))
            try:
                module = importlib.import_module(name.removesuffix(".__init__"))
                _collect(module, group, experiments)
            except Exception as error:
                broken[name] = error
    return Catalogue(experiments, broken)


def _collect(module, group, experiments):
    for thing in vars(module).values():
        declared = getattr(thing, "experiment", None)
        if not isinstance(declared, Experiment) or thing.__module__ != module.__name__:
            continue
        if declared.id in experiments:
            raise ValueError(f"experiment {declared.id} is declared again in {module.__name__}")
        if not declared.id.startswith(group + "."):
            raise ValueError(f"experiment {declared.id} stands in folder {group}; move either")
        experiments[declared.id] = declared


def select(experiments, ids, profile):
    """Return the experiments of ids or leading parts of ids, in catalogue order; without ids, all.

    Raises ValueError for an id that names none, or only experiments without that profile.
    """
    chosen = {i: e for i, e in experiments.items() if profile in e.profiles}
    if not ids:
        return list(chosen.values())
    for wanted in ids:
        if not any(_names(wanted, i) for i in chosen):
            raise ValueError(_no_such(wanted, experiments, profile))
    return [e for i, e in chosen.items() if any(_names(wanted, i) for wanted in ids)]


def _names(wanted, id):
    return id == wanted or id.startswith(wanted.rstrip(".") + ".")


def _no_such(wanted, experiments, profile):
    others = [e for i, e in experiments.items() if _names(wanted, i)]
    if others:
        return f"{wanted} has no {profile} profile; it has: {', '.join(others[0].profiles)}"
    near = ", ".join(nearest(wanted, experiments)) or "none"
    return f"no experiment {wanted!r}; near it: {near}; see `python -m validation list`"


def nearest(wanted, ids):
    """Return the ids of which a part is like a text, whatever its case, nearest first."""
    likeness = {id: _likeness(wanted.lower(), id.lower()) for id in ids}
    near = sorted(likeness, key=likeness.get, reverse=True)
    return [id for id in near if likeness[id][0] >= NEAR][:OFFERED]


def _likeness(wanted, id):
    """Return the likeness of a text to the best part of an id, and to the entire id, in [0, 1]."""
    words = id.split(".")
    n = len(words)
    parts = [".".join(words[i:j]) for i in range(n) for j in range(i + 1, n + 1)]
    like = {part: SequenceMatcher(None, wanted, part).ratio() for part in parts}
    return max(like.values()), like[id]
