"""The loop of `mpm-ref rom play` on a terminal, at true speed."""

from time import perf_counter

from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.text import Text

from .pace import RealTimePace
from .play_loop import FRAME, advance
from .play_screen import KEYS, Screen, status_line, warning_line

BORDER, LINES = 2, 4        # characters of the panel in each direction, and lines below it


def play_on_terminal(session, keys, title, console=None):
    """Play a session until it has ended, with a `Keyboard`, on a rich `Console`, by default that of
    the terminal.
    """
    screen, clock = Screen(session), perf_counter
    now = clock()
    pace, frame_end = RealTimePace(session.dt, now, session.played), now
    console = console or Console()
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
