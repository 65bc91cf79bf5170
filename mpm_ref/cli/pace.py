"""The pace of a run that is played: simulated time against the time of a clock.

A run that is ahead of the clock waits. One that is behind does not hurry afterwards, since motion
would then be faster than it is: the time that it lacks is counted instead.
"""

from collections import deque

SPAN = 1.0          # at the end of which the real-time factor is taken [s]
ROUNDING = 1e-9     # of a step: one that is due this little later is due


class RealTimePace:
    """The simulated time that is due, what it lacks, and the real-time factor.

    Times that were played are those of all steps, over restarts; times of the clock begin anywhere.
    All are in s.
    """

    def __init__(self, dt, now, played):
        self.dt = dt            # of a step
        self.reset(now, played)

    def reset(self, now, played):
        """Count from here on, as after a pause."""
        self.due, self.behind = played, 0.0
        self._marks = deque([(now, played)])

    def allow(self, seconds):
        """Let the run go on by some seconds."""
        self.due += seconds

    def is_due(self, played):
        """Return whether the end of the next step is due."""
        return played + (1.0 - ROUNDING) * self.dt <= self.due

    def mark(self, now, played):
        """Note what was played by now; steps that are due and were not made are not made up for."""
        if self.is_due(played):
            self.behind += self.due - played
            self.due = played
        self._marks.append((now, played))
        while len(self._marks) > 2 and self._marks[1][0] <= now - SPAN:
            self._marks.popleft()

    @property
    def factor(self):
        """The simulated time over that of the clock, in the last `SPAN`; None before it is over."""
        (then, before), (now, played) = self._marks[0], self._marks[-1]
        return (played - before) / (now - then) if now - then >= SPAN else None
