"""NSF's experiments as studies: a scene, one parameter, runs to make fields of and runs to test on
(NSF-sec4.5, appendix A of the paper).

Coarse grids are those of the quick profile: dx and dt are larger by the same factor, particles
fewer by its cube, so that a cell has as many and waves pass as much of one in a step.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.reduced.vary import varied
from mpm_ref.rom.spanned import Sizes

from ..verification.scenes import shipped


class Study(NamedTuple):
    """Runs of one scene that differ in the value of one key."""

    scene: str
    key: str
    train: tuple            # values
    test: tuple             # values
    sizes: Sizes
    samples: int            # |S|
    follows: bool           # whether the stress is told the parameter (NSF-mu-dep)
    coarser: int = 1        # factor of dx and dt
    steps: int | None = None    # in place of the scene's, of its own dt

    def run(self, value):
        """The scene of a run."""
        base = shipped(self.scene)
        bodies = {f"body.{body.name}.sampling.count": round(body.sampling.count / self.coarser**3)
                  for body in base.body}
        steps = (self.steps or base.steps) // self.coarser
        return varied(base, {self.key: float(value), **bodies, "dx": base.dx * self.coarser,
                             "dt": base.dt * self.coarser, "steps": steps})


def jelly(coarser=1):
    """A cube thrown at a wall at several speeds: 3 runs and a test as in appendix A; which speeds
    is not printed. Speeds are seen in positions, so the stress need not be told.
    """
    return Study("nsf_jelly", "body.cube.velocity.linear[0]", (0.3, 0.4, 0.5), (0.45,),
                 Sizes(r=5, smoothing=1e-4), 50, follows=False, coarser=coarser)


def sand(coarser=1, train=16):
    """A column of sand with several angles of friction: 16 runs from 21 to 38.5 degrees and 4 tests
    as in appendices A and B; which angles are tested is not printed. In the 100 steps of the
    authors' script it has hardly begun to spread, and all angles look the same: it falls longer.
    """
    return Study("nsf_sand", "body.sand.material.flow.friction_angle",
                 tuple(np.linspace(21.0, 38.5, train)), (23.0, 27.5, 32.0, 36.5),
                 Sizes(r=6, smoothing=1.0), 150,
                 follows=True, coarser=coarser, steps=300)
