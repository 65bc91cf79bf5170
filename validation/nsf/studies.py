"""NSF's experiments as studies: a scene, one parameter, runs to make fields of and runs to test on
(NSF-sec4.5, appendix A of the paper).

Coarse grids are those of the quick profile: dx and dt are larger by the same factor, particles
fewer by its cube, so that a cell has as many and waves pass as much of one in a step.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.study.samples import cell_samples, drawn_samples, weighted_samples
from mpm_ref.scene import Poisson
from mpm_ref.scene.overrides import with_values

from ..common.scenes import catalogue_scene


class NsfStudy(NamedTuple):
    """Runs of one scene that differ in the value of one key."""

    scene: str
    key: str
    train: tuple            # values
    test: tuple             # values
    sizes: Sizes
    samples: int            # |S|
    follows: bool           # whether the stress depends on the parameter (NSF-mu-dep)
    coarser: int = 1        # factor of dx and dt
    steps: int | None = None    # in place of the scene's, of its own dt
    every: int = 1          # steps of the scene between the snapshots that fields are made of
    column: float | None = None     # radius of the upright one that samples are drawn from [dx]
    later: int | None = None        # |S| in the second half, if another
    by_cell: bool = False   # whether samples with weights are those of `count` cells

    def run(self, value):
        """Return the scene of a run."""
        base = catalogue_scene(self.scene)
        bodies = {f"body.{body.name}.sampling.count": round(body.sampling.count / self.coarser**3)
                  for body in base.body if isinstance(body.sampling, Poisson)}
        steps = (self.steps or base.steps) // self.coarser // self.spacing * self.spacing
        return with_values(base, {self.key: float(value), **bodies, "dx": base.dx * self.coarser,
                             "dt": base.dt * self.coarser, "steps": steps})

    @property
    def spacing(self):
        """The number of steps of a run between snapshots."""
        return max(1, self.every // self.coarser)

    def chosen(self, one, count, draw, fields=None):
        """Return the sample sets of a run of a `FullModel`, as of `FieldRunOptions`: `count` points
        drawn at random, of a column in the middle if the study has one, and others half-way; by
        cubature of fields if these are given, point by point or cell by cell.
        """
        candidates = np.arange(len(one.X))
        if self.column is not None and count < len(candidates):
            off = one.X - 0.5 * (one.X.min(axis=0) + one.X.max(axis=0))
            candidates = np.flatnonzero(np.hypot(*off.T[:2]) <= self.column * one.problem.dx)
        weighted = (partial(cell_samples, fields, one.problem) if self.by_cell
                    else partial(weighted_samples, fields))
        pick = drawn_samples if fields is None else weighted
        sets = [pick(candidates, count, draw)]
        if self.later is not None and count == self.samples:
            clock = one.problem.clock
            sets.append(pick(candidates, self.later, draw, 0.5 * clock.steps * clock.dt))
        return tuple(sets)


def jelly(coarser=1):
    """A cube thrown at a wall at several speeds: 3 runs and a test as in appendix A; which speeds
    is not printed. Positions determine the speeds, so the stress need not depend on them.
    """
    return NsfStudy("nsf_jelly", "body.cube.velocity.linear[0]", (0.3, 0.4, 0.5), (0.45,),
                    Sizes(r=5, smoothing=1e-4), 50, follows=False, coarser=coarser)


def sand(coarser=1, train=16):
    """A column of sand with several angles of friction: 16 runs from 21 to 38.5 degrees and 4 tests
    as in appendices A and B; which angles are tested is not printed. In the 100 steps of the
    authors' script it has hardly begun to spread, and all angles look the same: it falls longer. At
    the printed resolution every second step is kept, so that as many snapshots are.
    """
    return NsfStudy("nsf_sand", "body.sand.material.flow.friction_angle",
                    tuple(np.linspace(21.0, 38.5, train)), (23.0, 27.5, 32.0, 36.5),
                    Sizes(r=6, smoothing=1.0), 150,
                    follows=True, coarser=coarser, steps=300, every=2)


def metal(coarser=1, train=12):
    """A metal frame with several hardening coefficients: 12 runs and 4 tests as in appendix A;
    which coefficients is not printed.
    """
    return NsfStudy("nsf_metal", "body.metal.material.flow.xi", tuple(np.linspace(0.0, 0.2, train)),
                    (0.03, 0.08, 0.12, 0.17), Sizes(r=5, smoothing=1e-2), 50,
                    follows=True, coarser=coarser, every=6)


def bread(coarser=1, train=20):
    """A slice of bread of several moduli: 20 runs and 4 tests as in appendix A; which moduli is not
    printed but their range. They are rounded, as processors differ in the last bits of a power.
    """
    moduli = np.geomspace(1.0, 13.0, train).round(12)
    return NsfStudy("nsf_bread", "body.bread.material.E", tuple(moduli), (1.6, 3.3, 6.0, 10.0),
                    Sizes(r=6, modes=40, smoothing=1e-2), 450, follows=True, coarser=coarser,
                    every=10)


def cake(coarser=1, train=12):
    """A cake cut at several angles: 12 runs and 3 tests as in appendix A; which angles is not
    printed. Samples are in the middle, 700, then 400 (section 6.1); how near it is not printed:
    here as near as gives the printed number of integration points.
    """
    return NsfStudy("nsf_cake", "collider.blade.motion.angle", tuple(np.linspace(0.0, 30.0, train)),
                    (4.0, 15.0, 26.0), Sizes(r=6, smoothing=1e-2), 700,
                    follows=False, coarser=coarser, every=8, column=2.0, later=400)


def toothpaste(coarser=1, train=12):
    """Toothpaste on brushes at several inclinations: 12 runs and 4 tests as in appendix A, one of
    them the printed 7.1 degrees.
    """
    return NsfStudy("nsf_toothpaste", "collider.brush.motion.angle",
                    tuple(np.linspace(0.0, 15.0, train)), (2.0, 5.0, 7.1, 12.0),
                    Sizes(r=6, modes=40, smoothing=1e-5), 50,
                    follows=False, coarser=coarser, every=5)


def ball(coarser=1):
    """A squishy ball on planes of several inclinations: 3 runs and a test as in appendix A; which
    inclinations is not printed.
    """
    return NsfStudy("nsf_ball", "collider.plane.motion.angle", (15.0, 20.0, 25.0), (22.5,),
                    Sizes(r=6, smoothing=1e-2), 300, follows=False, coarser=coarser, every=3)
