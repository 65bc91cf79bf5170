"""Keys of `mpm-ref rom play`: from bytes of a terminal, or from a text, to commands."""

import os
import select
import sys
from contextlib import contextmanager, suppress
from math import isfinite
from typing import NamedTuple

from ..rom.study.play import PlayCommand

try:
    import termios
    import tty
except ImportError:         # not a POSIX system
    termios = tty = None

COMMANDS = {
    "left": PlayCommand.TILT_LEFT, "right": PlayCommand.TILT_RIGHT,
    "up": PlayCommand.STRENGTHEN, "down": PlayCommand.WEAKEN,
    "space": PlayCommand.PAUSE, "r": PlayCommand.RESTART, "q": PlayCommand.QUIT,
}
ARROWS = {b"A": "up", b"B": "down", b"C": "right", b"D": "left"}
PLAIN = {b" ": "space", b"r": "r", b"R": "r", b"q": "q", b"Q": "q"}
ESCAPE, OPENERS = b"\x1b", b"[O"        # how an arrow begins: both together
PARAMETERS = range(0x20, 0x40)          # bytes between these and the last one, as of Shift-F2
READ = 1024         # bytes at a time


class Keys(NamedTuple):
    """Names of keys, and bytes that may be the beginning of another one."""

    names: list
    rest: bytes


class TimedCommand(NamedTuple):
    """A command at a time of a session."""

    t: float                # [s]
    command: PlayCommand


def parse_keys(data):
    """Return the `Keys` of a terminal's bytes; those of other keys are left out."""
    names, k = [], 0
    while k < len(data):
        if data[k:k + 1] != ESCAPE:
            names.append(PLAIN.get(data[k:k + 1]))
            k += 1
        elif k + 1 < len(data) and data[k + 1] not in OPENERS:
            k += 1
        else:
            last = end_of_sequence(data, k)
            if last is None:
                break
            names.append(ARROWS.get(data[k + 2:last + 1]))
            k = last + 1
    return Keys([name for name in names if name], data[k:])


def end_of_sequence(data, k):
    """Return the place of the last byte of the sequence that an escape at k and an opener begin;
    None where it is still to come.
    """
    return next((i for i in range(k + 2, len(data)) if data[i] not in PARAMETERS), None)


def parse_script(text):
    """Return the `TimedCommand`s, in order of time, of a text such as "0.5 right, 1 up". Raises
    ValueError.
    """
    return sorted((timed_command(part) for part in text.split(",")), key=lambda one: one.t)


def timed_command(text):
    """Return the `TimedCommand` of a text such as "0.5 right". Raises ValueError."""
    match text.split():
        case [time, key] if key in COMMANDS:
            with suppress(ValueError):
                if isfinite(t := float(time)) and t >= 0.0:
                    return TimedCommand(t, COMMANDS[key])
    raise ValueError(f"--keys {text.strip()!r}: expected a time in s and a key, such as \"0.5 "
                     f"right\"; keys are {', '.join(COMMANDS)}, and commas stand between them")


class Keyboard:
    """The keys that are pressed on a POSIX terminal, read without waiting for a line."""

    def __init__(self, descriptor):
        self.descriptor, self._rest = descriptor, b""

    def commands(self, seconds=0.0):
        """Return the commands of the keys pressed so far, or else of the first ones within some
        seconds; that to quit where the terminal is gone.
        """
        ready, _, _ = select.select([self.descriptor], [], [], max(seconds, 0.0))
        if not ready:
            return []
        data = os.read(self.descriptor, READ)
        if not data:
            return [PlayCommand.QUIT]
        names, self._rest = parse_keys(self._rest + data)
        return [COMMANDS[name] for name in names]


def require_terminal():
    """Raise ValueError unless keys can be read and pictures drawn on the terminal."""
    advice = "; play there, or add --seconds S to play without a terminal"
    if termios is None:
        raise ValueError(f"keys are read on POSIX systems alone, not on {sys.platform}{advice}")
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise ValueError(f"keys and pictures need a terminal, and there is none here{advice}")
    if "utf" not in (sys.stdout.encoding or "").lower():
        raise ValueError(f"pictures are braille characters, and the terminal's encoding is "
                         f"{sys.stdout.encoding}: expected UTF-8, as in LANG=C.UTF-8{advice}")


@contextmanager
def keyboard():
    """Give the `Keyboard` of the terminal, whose settings are restored afterwards."""
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor)
        yield Keyboard(descriptor)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
