"""End a command on an error with one line on stderr and an exit status, without traceback."""

import errno
import os
import re
import sys
from contextlib import contextmanager

import typer

from ..core.grid import OutOfRange
from ..executor import BadScheduler, SchedulerLost
from ..monitor import Unstable
from ..scene import SceneError
from ..store.atomic import NotWritten
from ..store.checkpoint import BadCheckpoint
from ..store.checksums import Damaged
from ..store.journal import InUse
from ..store.results import BadResults
from ..store.running import Refused
from ..timestep import TooLarge

LONGEST, LONGEST_WORD, SHOWN = 2000, 300, 100       # characters of a sentence, of a word in it
UNREADABLE = (errno.ENAMETOOLONG, errno.EACCES, errno.ELOOP)    # of files named by the user
BAD_INPUT, UNSTABLE, NOT_WRITTEN, INTERRUPT = 2, 3, 4, 130
FAULTS = (SceneError, TooLarge, OutOfRange, Refused, BadCheckpoint, BadResults, InUse, Damaged,
          BadScheduler)


@contextmanager
def exit_on_errors():
    """End the command on bad input, file errors and Ctrl-C; others keep their traceback as bugs."""
    try:
        yield
        sys.stdout.flush()          # here a full disk is noticed, not at the interpreter's end
    except FAULTS as fault:
        end(fault, BAD_INPUT)
    except (NotWritten, SchedulerLost) as fault:
        end(fault, NOT_WRITTEN)
    except OSError as fault:
        if fault.errno == errno.ENOSPC and fault.filename is None:
            end_without_output(fault)
        if fault.errno not in UNREADABLE:
            raise
        end(f"{fault.filename}: {fault.strerror}; name another file", BAD_INPUT)
    except KeyboardInterrupt:
        end("interrupted", INTERRUPT)


@contextmanager
def options():
    """End the command on any ValueError, as bad input, while options are checked."""
    try:
        yield
    except ValueError as fault:
        end(fault, BAD_INPUT)


@contextmanager
def writing():
    """Turn an OSError in this context into `NotWritten`."""
    try:
        yield
    except OSError as fault:
        raise NotWritten(str(fault)) from fault


@contextmanager
def at_start(name):
    """End the command if the first state of a scene is faulty; the message begins with its name."""
    try:
        yield
    except (OutOfRange, TooLarge) as fault:
        end(f"{name}: {fault}", BAD_INPUT)
    except Unstable as fault:
        end(f"{name}: {fault}", UNSTABLE)


def end_without_output(fault):
    """End the command when its answer cannot be printed, as on a full disk."""
    sys.stdout = open(os.devnull, "w", encoding="utf-8")        # Python flushes it at the end
    end(f"the answer could not be printed: {fault.strerror}; is the disk full?", NOT_WRITTEN)


def end(message, status):
    """Print a sentence on stderr and end the command with an exit status."""
    print(f"mpm-ref: {shortened(' '.join(str(message).split()))}", file=sys.stderr)
    raise typer.Exit(status)


def shortened(sentence):
    """Return a sentence without the middle of its long words, and of itself if it is long."""
    sentence = re.sub(rf"\S{{{LONGEST_WORD},}}", lambda word: _ends(word[0], SHOWN), sentence)
    return sentence if len(sentence) <= LONGEST else _ends(sentence, LONGEST)


def _ends(text, length):
    return f"{text[:length // 2]}...{text[-length // 2:]}"
