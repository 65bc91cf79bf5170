"""A study: a scene, the parameters of many runs of it, and the reduced model to be made of them.

`load` reads it from a TOML file; docs/reference/studies.md explains the keys.
"""

import hashlib
import json
from itertools import product
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ... import scene
from ...scene import SceneError
from ...scene.messages import at, opened_by
from ...scene.overrides import flat, varied
from .nsf_levels import every
from .study_file import checked, plain
from .tables import LATIN, LDM, NETWORK, NSF, Runs

SAME = ("dim", "dx", "dt", "steps", "every", "seed", "scheme", "integrator")    # in all runs
SUMMED = ("modes", "tau", "C")      # numbers of modes, of maps and fields that are sums of them
VARIED = {LDM: 'gravity, a material or a motion; with model = "nsf" a velocity at the start too',
          NSF: "gravity, a material, a motion or a velocity at the start"}
FREE = {LDM: ("material",), NSF: ("material", "velocity")}      # of a body, from run to run


class Study(NamedTuple):
    """Runs of one scene, numbered, some of them held out."""

    path: Path
    base: object            # the `Scene` with what is set in all runs
    tables: Runs            # `Tables` of its model
    mu: np.ndarray          # (runs, parameters)
    test: tuple             # numbers of the runs that are held out

    @property
    def names(self):
        """Names of the parameters."""
        return tuple(one.name for one in self.tables.parameter)

    @property
    def train(self):
        """Numbers of the runs that the map is made of."""
        return tuple(k for k in range(len(self.mu)) if k not in self.test)

    def scene(self, mu):
        """The scene of a run with parameters mu (parameters,)."""
        return varied(self.base, {one.key: one.scale * float(value) for one, value in
                                  zip(self.tables.parameter, mu, strict=True)})

    def given(self, texts):
        """Parameters [..] of a run, from texts NAME=VALUE. Raises SceneError."""
        found = {}
        for text in texts:
            name, _, value = text.partition("=")
            if name not in self.names:
                raise SceneError(f"{text}: expected NAME=VALUE with one of the study's parameters "
                                 f"{', '.join(self.names)}")
            found[name] = number(text, value)
        for name in self.names:
            if name not in found:
                raise SceneError(f"the parameter {name} is not given: add --set {name}=VALUE")
        return [found[name] for name in self.names]

    def outside(self, mu):
        """Sentences about parameters beyond the runs that the map is made of."""
        trained = self.mu[list(self.train)]
        for name, value, low, high in zip(self.names, mu, trained.min(axis=0), trained.max(axis=0),
                                          strict=True):
            if not low <= value <= high:
                yield (f"{name} = {value:g} lies outside the range {low:g} .. {high:g} of the runs "
                       "that the map is made of")

    @property
    def digest(self):
        """sha256 of all runs' scenes and of which are held out: what a map is a map of."""
        texts = [scene.canonical(self.scene(mu)) for mu in self.mu]
        return hashlib.sha256(json.dumps([texts, self.test]).encode()).hexdigest()


def load(path, shipped=None):
    """The `Study` of a TOML file; shipped {name: path} are scenes that it may name. Raises
    SceneError, which names the file and the key.
    """
    path = Path(path)
    data = plain(path)
    with opened_by(str(path)):
        tables = checked(data)
        mu = parameters(tables)
        base = base_of(tables, path.parent, shipped or {}, SHOWN[tables.model])
        study = Study(path, base, tables, mu, held_out(len(mu), tables.test, tables.seed))
        _require_one_body(study)
        _require_states(study)
        _require_step(study)
        return study


def number(text, value):
    """A finite number; text is where it stands. Raises SceneError."""
    try:
        if isfinite(found := float(value)):
            return found
    except ValueError:
        pass
    raise SceneError(f"{text}: expected a finite number, not {value!r}")


def parameters(tables):
    """Parameters (runs, parameters) of all runs: every combination, the last one fastest; or a
    Latin hypercube.
    """
    if tables.sampling != LATIN:
        axes = []
        for k, one in enumerate(tables.parameter):
            with at(f"parameter[{k}]"):
                axes.append(one.grid())
        return np.array(list(product(*axes)))
    for k, one in enumerate(tables.parameter):
        if one.values is not None or one.count is not None:
            raise SceneError(f'parameter[{k}]: expected `from` and `to` alone with sampling = '
                             f'"{LATIN}"; `count = N` stands beside `sampling`')
    ends = [(one.start, one.stop) for one in tables.parameter]
    return latin(tables.count, ends, np.random.default_rng(tables.seed))


def latin(count, ends, rng):
    """A Latin hypercube (count, parameters) in ranges (low, high): of count equal parts of each
    range, each has one value, anywhere in it. The same as SciPy's, whose module asks for PyTorch.
    """
    low, high = np.transpose(ends)
    u = rng.uniform(size=(count, len(ends)))
    strata = np.tile(np.arange(1, count + 1), (len(ends), 1))
    for row in strata:
        rng.shuffle(row)
    return (strata.T - u) / count * (high - low) + low


def held_out(runs, count, seed):
    """Numbers of so many runs, drawn at random. Raises SceneError where none would be left."""
    if count >= runs:
        raise SceneError(f"test = {count}: expected fewer than the {runs} runs of the study")
    return tuple(sorted(np.random.default_rng(seed).permutation(runs)[:count].tolist()))


def each(base, changes):
    """Steps from one frame to the next, where every one is shown."""
    return 1


SHOWN = {LDM: each, NSF: every}


def base_of(tables, folder, shipped, spacing=each):
    """The scene of a study's `Tables` with what is `set` in all runs; shipped {name: path} are
    scenes that may be named, spacing a function of the scene and changes as `each` is. Raises
    SceneError.
    """
    path = folder / tables.scene
    if not path.is_file():
        path = shipped.get(tables.scene)
    if path is None:
        raise SceneError(f"scene = {tables.scene!r}: there is no such file, nor a shipped scene of "
                         f"that name; shipped scenes: {', '.join(shipped) or 'none'}")
    base = scene.load(path)
    with opened_by("set"):
        changes = flat(tables.set)
        base = varied(base, changes | {"every": spacing(base, changes), "interval": None})
    if base.dt is None or base.steps is None:
        raise SceneError(f"scene = {tables.scene!r}: expected one with `dt` and `steps`, so that "
                         "all runs have the same time levels")
    return base


def _require_one_body(study):
    """Raise SceneError where parameters lead nowhere, or change the particles, grid or steps."""
    first = None
    for mu in study.mu:
        with opened_by("parameter"):
            found = _kept(study.scene(mu), FREE[study.tables.model])
        first = first or found
        for name, value in found.items():
            if value != first[name]:
                raise SceneError(f"parameter: runs differ in `{name}` of the scene, but all need "
                                 "the same particles, grid and steps; vary "
                                 f"{VARIED[study.tables.model]}")


def _require_states(study):
    """Raise SceneError for more modes than the training runs keep states."""
    base, map, runs = study.base, study.tables.map, len(study.train)
    states = runs * (base.steps // base.every + 1)
    for name in ("r", *SUMMED) if map.kind != NETWORK else ():
        count = getattr(map, name, None) or 0
        if count > states:
            raise SceneError(f"map.{name} = {count}: the {runs} training runs keep {states} "
                             "states, which hold no more modes than that; set "
                             f"`{name}` to less, or take more runs")


def _require_step(study):
    """Raise SceneError for reduced steps that are longer than the scene."""
    faster, steps = getattr(study.tables.run, "faster", 1.0), study.base.steps
    if faster > steps:
        raise SceneError(f"run.faster = {faster:g}: expected at most {steps}, the steps of the "
                         "scene")


def _kept(one, free):
    """What must be the same in all runs, by name; not what is free of a body."""
    bodies = {f"body[{k}].{name}": getattr(body, name) for k, body in enumerate(one.body)
              for name in body.__struct_fields__ if name not in free}
    return {name: getattr(one, name) for name in SAME} | bodies
