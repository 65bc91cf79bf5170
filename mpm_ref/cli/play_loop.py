"""The loop of `mpm-ref rom play` without a terminal, at full speed, and what it measures.

As `play_terminal`, it makes the steps that are due, checks the state and draws it, in frames of
`FRAME`.
"""

from math import ceil, inf
from operator import add, sub
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

from .pace import ROUNDING, RealTimePace
from .play_screen import Screen

FRAME = 0.05            # [s] from one picture to the next, at least
SIZE = 80, 20           # characters of a picture without a terminal
SECOND = round(1.0 / FRAME)     # frames of a second


class PlayedTime(NamedTuple):
    """The time that a session without a terminal simulated, and the time that it took [s]."""

    played: float
    wall: float
    cpu: float              # of all threads
    slowest: float          # real-time factor of the slowest second that was simulated
    pictures: int
    beyond: int             # pictures with latent coordinates out of the range of training
    breakdown: str          # the sentence about the first breakdown, or ""

    @property
    def factor(self):
        """The real-time factor: simulated time over wall time."""
        return self.played / self.wall if self.wall else 0.0


def advance(session, pace, clock, deadline=inf):
    """Make the steps of a session that are due: one, and others until a time of the clock [s]."""
    while session.is_running and pace.is_due(session.played):
        session.step()
        if clock() >= deadline:
            break
    note = pace.mark if session.is_running else pace.reset
    note(clock(), session.played)


def play_script(session, script, seconds):
    """Play a session for some seconds with the `TimedCommand`s of a script, and return its
    `PlayedTime`. It does not wait where it is ahead of real time, and makes all steps where it is
    behind.
    """
    screen, clock, script = Screen(session), perf_counter, list(script)
    pace, marks, beyond = RealTimePace(session.dt, clock(), session.played), [(0.0, 0.0, 0.0)], []
    breakdown = ""
    for k in range(ceil(seconds / FRAME - ROUNDING)):
        while script and script[0].t <= (k + ROUNDING) * FRAME:
            session.obey(script.pop(0).command)
        if session.has_ended:
            break
        is_running, begin = session.is_running, (clock(), process_time(), session.played)
        pace.allow(FRAME)
        advance(session, pace, clock)
        beyond.append(session.check())
        breakdown = breakdown or session.breakdown
        screen.picture(*SIZE)
        if is_running:
            end = clock(), process_time(), session.played
            marks.append(tuple(map(add, marks[-1], map(sub, end, begin))))
    return played_time(marks, beyond, breakdown)


def played_time(marks, beyond, breakdown):
    """Return the `PlayedTime` of the times (wall, CPU, played) [s] at the ends of the frames in
    which the run went on, after those of the start, the sentences of all frames, and that about a
    breakdown.
    """
    wall, cpu, played = np.transpose(marks)
    frames = max(min(SECOND, len(marks) - 1), 1)
    spent, done = (a[frames:] - a[:-frames] for a in (wall, played))
    slowest = float((done / spent).min()) if len(spent) else 0.0
    return PlayedTime(float(played[-1]), float(wall[-1]), float(cpu[-1]), slowest, len(beyond),
                      sum(map(bool, beyond)), breakdown)
