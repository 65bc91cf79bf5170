"""Make or read the full-order run that the laws of a study are learned from, with progress."""

from ..nclaw.study import training
from ..nclaw.study.compare import threads_for
from ..store.running import Watch
from ..trajectories import observed
from .errors import INTERRUPT, end
from .terminal import passing, tell


def motion(study, data):
    """`Observed` of a study's scene: made, or of a results file, which is made if need be."""
    problem = study.problem()
    with threads_for(problem.bodies):
        if data is None:
            tell(f"computing the full-order run of {study.path}")
            with passing(desc="full-order run", bar_format="{desc}", leave=False):
                return observed(problem)
        if not training.is_complete(data, problem):
            with passing(total=problem.clock.steps, unit="step", desc=str(data)) as bar:
                made = training.make_run(data, study.problem(), Steps(bar))
            if made < problem.clock.steps:
                end(f"interrupted at step {made} of {problem.clock.steps} of the run to learn "
                    "from; the same command again goes on", INTERRUPT)
    return training.read_run(data, problem)


class Steps(Watch):
    """A run on a bar of steps."""

    def __init__(self, bar):
        self.bar = bar

    def step(self, state, dt):
        """Move the bar."""
        self.bar.update(state.step - self.bar.n)
