"""Output of commands: JSON, lists of titles, progress bars and warnings."""

import json
import shutil
import sys
from contextlib import contextmanager

from tqdm import tqdm

WIDEST = 100        # columns of a line of progress
COMPILING = "compiling kernels: seconds, once per version"


def passing(quiet=False, **line):
    """Return a tqdm progress bar, shown on terminals only, and not if quiet."""
    size = shutil.get_terminal_size((WIDEST, 24))
    return tqdm(file=sys.stderr, disable=quiet or None, ncols=min(size.columns, WIDEST),
                nrows=size.lines, **line)      # tqdm shows nothing where they are unknown


@contextmanager
def compiling(quiet=False):
    """Show on a terminal that kernels are compiled while the block runs."""
    line = passing(quiet, desc=COMPILING, bar_format="{desc}", leave=False)
    try:
        yield line
    finally:
        line.close()


def warn(sentences):
    """Print warnings on stderr, a line each."""
    for sentence in sentences:
        print(f"mpm-ref: warning: {sentence}", file=sys.stderr)


def as_json(facts):
    """Return facts as JSON; numbers that are not finite become null."""
    return json.dumps(_finite(facts), indent=1)


def _finite(value):
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value


def print_titles(titles, machine_readable):
    """Print {name: title}, a line each or as JSON."""
    lines = [f"{name:24} {title}" for name, title in titles.items()]
    print(as_json(titles) if machine_readable else "\n".join(lines))
