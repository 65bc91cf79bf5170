"""The two loops of `mpm-ref rom play`: on a terminal at true speed, and without one at full speed.

Both make the steps that are due, check the state and draw it, in frames of `FRAME`.
"""

from math import ceil, inf
from time import perf_counter
from typing import NamedTuple

import numpy as np
from rich.console import Group
from rich.live import Live
from rich.panel import Panel
from rich.text import Text

from .pace import ROUNDING, Pace
from .play_screen import KEYS, Screen, status_line, warning_line

FRAME = 0.05                # [s] from one picture to the next, at least
SIZE = 80, 20               # characters of a picture without a terminal
BORDER, LINES = 2, 4        # characters of the panel in each direction, and lines below it
SECOND = round(1.0 / FRAME)     # frames of a second


class PlayedTime(NamedTuple):
    """The time that a session without a terminal simulated, and the time that it took [s]."""

    played: float
    wall: float
    slowest: float          # real-time factor of the slowest second that was simulated
    pictures: int
    beyond: int             # pictures with latent coordinates out of the range of training

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


# On a terminal.

def play_on_terminal(session, keys, console, title):
    """Play a session until it has ended, with a `Keyboard` and a rich `Console`."""
    screen, clock = Screen(session), perf_counter
    now = clock()
    pace, frame_end = Pace(session.dt, now, session.played), now
    with Live(console=console, screen=True, auto_refresh=False) as live:
        while not session.has_ended:
            for command in keys.commands(frame_end - clock()):
                session.obey(command)
            if clock() < frame_end:
                continue
            now, before = clock(), now
            frame_end = now + FRAME
            pace.allow(now - before)
            advance(session, pace, clock, frame_end)
            beyond = session.check()
            live.update(panel(screen, title, console.size, (
                status_line(session, pace), warning_line(session, beyond))), refresh=True)


def panel(screen, title, size, lines):
    """Return what a terminal of a rich `ConsoleDimensions` shows: the picture in a panel, with a
    title and the keys, and lines below.
    """
    columns = max(size.width - BORDER, 1)
    picture = screen.picture(columns, max(size.height - BORDER - LINES, 1))
    status, warning = lines
    return Group(Panel(Text("\n".join(picture), no_wrap=True), title=Text(title),
                       subtitle=Text(KEYS), padding=0),
                 Text(status, no_wrap=True), Text(warning, style="bold red"))


# Without a terminal.

def play_script(session, script, seconds):
    """Play a session for some seconds with the `TimedCommand`s of a script, and return its
    `PlayedTime`. It does not wait where it is ahead of real time, and makes all steps where it is
    behind.
    """
    screen, clock, script = Screen(session), perf_counter, list(script)
    pace, marks, beyond = Pace(session.dt, clock(), session.played), [(0.0, 0.0)], []
    for k in range(ceil(seconds / FRAME - ROUNDING)):
        while script and script[0].t <= (k + ROUNDING) * FRAME:
            session.obey(script.pop(0).command)
        if session.has_ended:
            break
        is_running, begin, before = session.is_running, clock(), session.played
        pace.allow(FRAME)
        advance(session, pace, clock)
        beyond.append(session.check())
        screen.picture(*SIZE)
        if is_running:
            wall, played = marks[-1]
            marks.append((wall + clock() - begin, played + session.played - before))
    return played_time(marks, beyond)


def played_time(marks, beyond):
    """Return the `PlayedTime` of the times (wall, played) [s] at the ends of the frames in which
    the run went on, after that of the start, and the sentences of all frames.
    """
    wall, played = np.transpose(marks)
    frames = max(min(SECOND, len(marks) - 1), 1)
    spent, done = (a[frames:] - a[:-frames] for a in (wall, played))
    slowest = float((done / spent).min()) if len(spent) else 0.0
    return PlayedTime(float(played[-1]), float(wall[-1]), slowest, len(beyond),
                      sum(map(bool, beyond)))
