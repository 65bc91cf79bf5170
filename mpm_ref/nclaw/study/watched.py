"""Whether learned laws that run beside the true ones leave the strains of their training (see
`nclaw.strain_watch`).
"""

from ...simulate import State
from ..bodies import learned
from ..strain_watch import known, look, sentence


class Watched:
    """The bodies of `weights.Laws` in a run of a `Problem`, looked at frame by frame; each is
    reported once, and none where the laws do not say what they have met.
    """

    def __init__(self, laws, problem):
        self.law, self.clock = learned(laws), problem.clock
        self.bounds, self.silent = known(laws.about, problem.dim), []

    def made(self, body):
        """A body of the learned laws, to be looked at."""
        own = self.law(body)
        if self.bounds is not None:
            self.silent.append(own)
        return own

    def news(self, frame):
        """The sentences about bodies that are astray for the first time, at a frame."""
        step = frame * self.clock.every
        state = State(tuple(self.silent), step, step * self.clock.dt)
        seen = [(body, look(body, self.bounds)) for body in self.silent]
        self.silent = [body for body, sight in seen if not sight.astray]
        return [sentence(sight, state, self.bounds) for _, sight in seen if sight.astray]
