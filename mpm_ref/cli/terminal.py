"""What is said on the error channel besides faults: notes that pass, progress, warnings."""

import shutil
import sys
from contextlib import contextmanager

from tqdm import tqdm

WIDEST = 100        # columns of a line of progress
COMPILING = "compiling kernels: seconds, once per version"


def passing(quiet=False, **line):
    """A line for people, a tqdm bar: on terminals only, and on none if quiet."""
    size = shutil.get_terminal_size((WIDEST, 24))
    return tqdm(file=sys.stderr, disable=quiet or None, ncols=min(size.columns, WIDEST),
                nrows=size.lines, **line)      # tqdm shows nothing where they are unknown


@contextmanager
def compiling(quiet=False):
    """While the block runs, a terminal says that kernels are compiled; then the line is gone."""
    line = passing(quiet, desc=COMPILING, bar_format="{desc}", leave=False)
    try:
        yield line
    finally:
        line.close()


def warn(sentences):
    """Say warnings, a line each."""
    for sentence in sentences:
        print(f"mpm-ref: warning: {sentence}", file=sys.stderr)
