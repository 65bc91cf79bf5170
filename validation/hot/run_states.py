"""States of a scene evenly over its entire run, on disk: steps from them are measured without the
run. A whole run of the standard profile (`run_history`) writes them, and so does what measures its
steps. They are of one version of the package and one scene; others are not read.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from mpm_ref.simulate import EVEN
from mpm_ref.store.checkpoint import BadCheckpoint, load, save

COUNT = 10          # states of a run


class RunStates(NamedTuple):
    """The files of a run's states, and the times from which each is the next state [s]."""

    folder: Path
    name: str           # of the scene
    times: np.ndarray   # (count,)

    def path(self, k):
        """Return the file of state k."""
        return self.folder / f"{self.name}-{k}-of-{len(self.times)}.h5"

    def is_due(self, k, state):
        """Return whether a state is that of number k, or later."""
        return k < len(self.times) and state.t >= self.times[k] * (1.0 - EVEN)

    def read(self, k, problem):
        """Return state k of a problem, None if it is not there."""
        try:
            state, same_source = load(self.path(k), problem)
        except (BadCheckpoint, OSError):
            return None
        return state if same_source else None

    def write(self, k, state, problem):
        """Write state k where there is room for it."""
        try:
            save(self.path(k), state, problem)
        except OSError:
            pass                # the run is repeated where it is needed


def even_times(problem, count=COUNT):
    """Return the middles of `count` equal parts of a problem's time [s]."""
    return problem.clock.end * (np.arange(count) + 0.5) / count
