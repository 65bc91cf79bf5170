"""A study of reduced models: a scene, parameters of many runs of it, and the model of them.

`load` reads it from a TOML file; docs/reference/studies.md explains the keys.
"""

import hashlib
import json
from itertools import product
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from ... import scene
from ...scene import SceneError
from ...scene.messages import errors_at, errors_of
from ...scene.overrides import flat, with_values
from ...scene.toml import read_tables
from .methods import METHODS, every_step
from .study_file import parse_tables
from .tables import CURVED, LATIN, LDM, MODES, NETWORK, NSF, SIZES, CommonTables

SAME = ("dim", "dx", "dt", "steps", "every", "seed", "scheme", "integrator")    # in all runs
SUMMED = ("modes", "tau", "C")      # numbers of modes, of maps and fields that are sums of them


class ReducedStudy(NamedTuple):
    """Numbered runs of one scene, some of which are held out, and the settings of their model."""

    path: Path
    base: object            # the `Scene` with the changes of all runs
    tables: CommonTables    # those of its method (see `TABLES`)
    mu: np.ndarray          # (runs, parameters)
    test: tuple             # numbers of the runs that are held out

    @property
    def method(self):
        """The `ReductionMethod` that the file names."""
        return METHODS[self.tables.model]

    @property
    def model_entry(self):
        """The entry {"model": name} of files of another method than LDM, whose files have none."""
        model = self.tables.model
        return {} if model == LDM else {"model": model}

    @property
    def names(self):
        """Names of the parameters."""
        return tuple(one.name for one in self.tables.parameter)

    @property
    def train(self):
        """Numbers of the runs that the reduced model is computed from."""
        return tuple(k for k in range(len(self.mu)) if k not in self.test)

    def scene(self, mu):
        """Return the scene of a run with parameters mu (parameters,)."""
        return with_values(self.base, {one.key: one.scale * float(value) for one, value in
                                  zip(self.tables.parameter, mu, strict=True)})

    def parse_parameters(self, texts):
        """Return the parameters [..] of a run, from texts NAME=VALUE. Raises SceneError."""
        values = {}
        for text in texts:
            name, _, value = text.partition("=")
            if name not in self.names:
                raise SceneError(f"{text}: expected NAME=VALUE with one of the study's parameters "
                                 f"{', '.join(self.names)}")
            values[name] = number(text, value)
        for name in self.names:
            if name not in values:
                raise SceneError(f"the parameter {name} is not given: add --set {name}=VALUE")
        return [values[name] for name in self.names]

    def range_warnings(self, mu):
        """Yield sentences about parameters beyond the runs that the map is made of."""
        trained = self.mu[list(self.train)]
        for name, value, low, high in zip(self.names, mu, trained.min(axis=0), trained.max(axis=0),
                                          strict=True):
            if not low <= value <= high:
                yield (f"{name} = {value:g} lies outside the range {low:g} .. {high:g} of the runs "
                       "that the map is made of")

    def with_kind(self, kind):
        """Return the study with a map of another kind; None: its own. Raises ValueError for an
        unknown one, and for one that needs other settings than the study has.
        """
        if kind is None:
            return self
        replace = msgspec.structs.replace
        try:
            table = replace(self.tables.reduced_model, kind=kind)
            return self._replace(tables=replace(self.tables, reduced_model=table))
        except ValueError as fault:
            hint = ""
            if kind == CURVED and self.tables.model != NSF:
                hint = (f"; a curved map needs a study that says so, {self.path} or a copy: in "
                        f'[map] kind = "{CURVED}" and `modes` larger than `r`, in [run] projection '
                        '= "nonlinear" (docs/reference/studies.md)')
            raise ValueError(f"{fault}{hint}") from None

    @property
    def digest(self):
        """The sha256 of all runs' scenes and of the numbers held out: it identifies the data."""
        texts = [scene.canonical(self.scene(mu)) for mu in self.mu]
        return hashlib.sha256(json.dumps([texts, self.test]).encode()).hexdigest()


def load(path, scenes=None):
    """Return the `ReducedStudy` of a TOML file; scenes {name: path} are those that it may name.
    Raises SceneError, which names the file and the key.
    """
    path = Path(path)
    data = read_tables(path)
    with errors_of(str(path)):
        tables = parse_tables(data)
        mu = parameters(tables)
        base = base_scene(tables, path.parent, scenes or {}, METHODS[tables.model].frame_spacing)
        study = ReducedStudy(path, base, tables, mu, held_out(len(mu), tables.test, tables.seed))
        _require_one_body(study)
        _require_states(study)
        _require_step(study)
        return study


def number(text, value):
    """Return a finite number; text: the option that it is part of. Raises SceneError."""
    try:
        if isfinite(result := float(value)):
            return result
    except ValueError:
        pass
    raise SceneError(f"{text}: expected a finite number, not {value!r}")


def parameters(tables):
    """Return the parameters (runs, parameters) of all runs: every combination, the last one
    fastest; or a Latin hypercube.
    """
    if tables.sampling != LATIN:
        axes = []
        for k, one in enumerate(tables.parameter):
            with errors_at(f"parameter[{k}]"):
                axes.append(one.grid())
        return np.array(list(product(*axes)))
    for k, one in enumerate(tables.parameter):
        if one.values is not None or one.count is not None:
            raise SceneError(f'parameter[{k}]: expected `from` and `to` alone with sampling = '
                             f'"{LATIN}"; `count = N` stands beside `sampling`')
    ends = [(one.start, one.stop) for one in tables.parameter]
    return latin(tables.count, ends, np.random.default_rng(tables.seed))


def latin(count, ends, rng):
    """Return a Latin hypercube (count, parameters) in ranges (low, high): of count equal parts of
    each range, each has one value, anywhere in it. SciPy's, with the same numbers, would import
    PyTorch.
    """
    low, high = np.transpose(ends)
    u = rng.uniform(size=(count, len(ends)))
    strata = np.tile(np.arange(1, count + 1), (len(ends), 1))
    for row in strata:
        rng.shuffle(row)
    return (strata.T - u) / count * (high - low) + low


def held_out(runs, count, seed):
    """Return the numbers of `count` runs, drawn at random. Raises SceneError where none would be
    left.
    """
    if count >= runs:
        raise SceneError(f"test = {count}: expected fewer than the {runs} runs of the study")
    return tuple(sorted(np.random.default_rng(seed).permutation(runs)[:count].tolist()))


def base_scene(tables, folder, scenes, frame_spacing=every_step):
    """Return the scene of a study's tables with the values of `set`; scenes {name: path} are those
    that may be named, frame_spacing a function as that of a `ReductionMethod`. Raises SceneError.
    """
    path = folder / tables.scene
    if not path.is_file():
        path = scenes.get(tables.scene)
    if path is None:
        raise SceneError(f"scene = {tables.scene!r}: there is no such file, nor a bundled scene of "
                         f"that name; bundled scenes: {', '.join(scenes) or 'none'}")
    base = scene.load(path)
    with errors_of("set"):
        changes = flat(tables.overrides)
        every = {"every": frame_spacing(base, changes), "interval": None}
        base = with_values(base, changes | every)
    if base.dt is None or base.steps is None:
        raise SceneError(f"scene = {tables.scene!r}: expected one with `dt` and `steps`, so that "
                         "all runs have the same time levels")
    return base


def _require_one_body(study):
    """Raise SceneError where parameters lead nowhere, or change the particles, grid or steps."""
    first = None
    for mu in study.mu:
        with errors_of("parameter"):
            fields = _fixed_fields(study.scene(mu), study.method.free_fields)
        first = first or fields
        for name, value in fields.items():
            if value != first[name]:
                raise SceneError(f"parameter: runs differ in `{name}` of the scene, but all need "
                                 "the same particles, grid and steps; vary "
                                 f"{study.method.parameters}")


def _require_states(study):
    """Raise SceneError for more modes than the training runs have states."""
    base, table, runs = study.base, study.tables.reduced_model, len(study.train)
    states = runs * (base.steps // base.every + 1)
    for name in ("r", *SUMMED) if table.kind != NETWORK else ():
        count = getattr(table, name, None) or 0
        if count > states:
            raise SceneError(f"map.{name} = {count}: the {runs} training runs keep {states} "
                             "states, which hold no more modes than that; set "
                             f"`{name}` to less, or take more runs")


def _require_step(study):
    """Raise SceneError for reduced steps that are longer than the scene."""
    factor, steps = getattr(study.tables.run, "dt_factor", 1.0), study.base.steps
    if factor > steps:
        raise SceneError(f"run.dt_factor = {factor:g}: expected at most {steps}, the steps of the "
                         "scene")


def _fixed_fields(scene, free):
    """Return {name: value} of a scene that are the same in all runs; free: names of a body that are
    not.
    """
    bodies = {f"body[{k}].{name}": getattr(body, name) for k, body in enumerate(scene.body)
              for name in body.__struct_fields__ if name not in free}
    return {name: getattr(scene, name) for name in SAME} | bodies


def training_hints(study):
    """Yield hints before fields are computed from a study's runs."""
    table = study.tables.reduced_model
    flowing = [body.name for body in study.base.body if body.material.flow.name != "none"]
    if (study.tables.model == NSF and table.kind == MODES and flowing
            and table.smoothing <= SIZES["smoothing"]):
        yield (f"map.smoothing = {table.smoothing:g} is for elastic matter, and that of "
               f"{', '.join(flowing)} flows: reduced runs are often far off then. Try 1e-6 to 1, "
               "and keep what mpm-ref rom evaluate likes best, first with all points as samples")
