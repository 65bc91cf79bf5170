"""A cell: a scene changed along some axes, with the probes and the reference that go with it."""

from functools import cached_property

import numpy as np

from ..scene import SceneError
from ..scene.validate import plain, validate_scene
from ..sweep.setting import scene_at, setting
from .axes import AXES, AXIS
from .crossing import crossing_solids

FINE, COARSE = 0.5, 2.0         # factors of dx of the companions


def cell_of(factors):
    """Return the key of a cell from {axis's name: factor}: pairs in the order of `AXES`, without
    the factors 1.
    """
    return tuple((axis.name, factors[axis.name]) for axis in AXES
                 if factors.get(axis.name, 1.0) != 1.0)


def cell_text(cell):
    """Return a cell in words."""
    return ", ".join(f"{name} x {factor:.4g}" for name, factor in cell) or "as given"


def physical(cell):
    """Return the cell without its numerical axes: the scene with the physical problem."""
    return tuple((name, factor) for name, factor in cell if not AXIS[name].is_numerical)


class CellScenes:
    """The scenes of cells, and their probes."""

    def __init__(self, scene, probes):
        """Prepare the cells of a scene whose end is a time.

        probes: (body, positions (n, d) [m]) of the scene as given.
        """
        self._scene, self._probes = scene, probes
        X = np.concatenate([X for _, X in probes])
        self.size = float(np.max(X.max(axis=0) - X.min(axis=0)))    # [m] of the bodies
        self._refusals = {}

    def tables(self, cell=()):
        """Return the plain tables of a cell, without the keys that have no value.

        Raises ValueError for a change that does not fit the scene.
        """
        tables = {key: value for key, value in plain(self._scene).items() if value is not None}
        for name, factor in cell:
            AXIS[name].change(tables, factor, self.size)
        return tables

    def scene(self, cell, dx=1.0):
        """Return the valid scene of a cell with dx times a factor, or the SceneError that says why
        there is none.
        """
        try:
            scene = validate_scene(self.tables(cell))
            return scene if dx == 1.0 else scene_at(scene, setting(dx=dx))
        except ValueError as fault:
            return fault if isinstance(fault, SceneError) else SceneError(str(fault))

    def refusal(self, cell):
        """Return why a cell is no scene to be run, "" where it is one. No run is made."""
        if cell not in self._refusals:
            scene = self.scene(cell)
            self._refusals[cell] = str(scene) if isinstance(scene, SceneError) else (
                self._crossing(cell, scene))
        return self._refusals[cell]

    def _crossing(self, cell, scene):
        """Return which solids a change of the speed carries into each other."""
        if "speed" not in dict(cell):
            return ""
        pairs = crossing_solids(scene, self._box(cell)) - self._crossing_as_given
        return "".join(f"{a} and {b} move into each other, which they do not in the scene as given"
                       for a, b in sorted(pairs)[:1])

    @cached_property
    def _crossing_as_given(self):
        return crossing_solids(self.scene(()), self._box(()))

    def _box(self, cell):
        """Return the corners of a box about the bodies of a cell, three times as large."""
        X = np.concatenate([X for _, X in self.probes(cell)])
        low, high = X.min(axis=0), X.max(axis=0)
        size = np.max(high - low)
        return low - size, high + size

    def probes(self, cell):
        """Return the probes of the scene as given where they are in a cell."""
        factors = dict(cell)
        cells = round((factors.get("origin", 1.0) - 1.0) * self.size / self._scene.dx)
        shift, scale = cells * self._scene.dx, factors.get("size", 1.0)
        return tuple((body, (X + shift) * scale) for body, X in self._probes)
