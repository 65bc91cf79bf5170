"""How faults end a command: one line on the error channel and an exit status, no traceback."""

import sys
from contextlib import contextmanager

import typer

from ..core.grid import OutOfRange
from ..monitor import Unstable
from ..scene import SceneError
from ..store.atomic import NotWritten
from ..store.checkpoint import BadCheckpoint
from ..store.journal import Damaged, InUse
from ..store.results import BadResults
from ..store.running import Refused
from ..timestep import TooLarge

BAD_INPUT, UNSTABLE, NOT_WRITTEN, INTERRUPT = 2, 3, 4, 130
FAULTS = (SceneError, TooLarge, OutOfRange, Refused, BadCheckpoint, BadResults, InUse, Damaged)


@contextmanager
def one_line():
    """Faults of the input, of files, and Ctrl-C where nothing waits for it; any other keeps its
    traceback: it is a bug.
    """
    try:
        yield
    except FAULTS as fault:
        end(fault, BAD_INPUT)
    except NotWritten as fault:
        end(fault, NOT_WRITTEN)
    except KeyboardInterrupt:
        end("interrupted", INTERRUPT)


@contextmanager
def options():
    """While options are checked, any ValueError is a fault of the input."""
    try:
        yield
    except ValueError as fault:
        end(fault, BAD_INPUT)


@contextmanager
def writing():
    """Errors of the system, of parts that know no `NotWritten`, are that."""
    try:
        yield
    except OSError as fault:
        raise NotWritten(str(fault)) from fault


@contextmanager
def at_start(name):
    """Faults of a scene's first state begin with its name, as those of its text do."""
    try:
        yield
    except (OutOfRange, TooLarge) as fault:
        end(f"{name}: {fault}", BAD_INPUT)
    except Unstable as fault:
        end(f"{name}: {fault}", UNSTABLE)


def end(message, status):
    """Say a sentence on the error channel and end the command."""
    print(f"mpm-ref: {' '.join(str(message).split())}", file=sys.stderr)
    raise typer.Exit(status)
