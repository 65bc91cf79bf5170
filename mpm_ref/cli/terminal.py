"""Output of commands: JSON, lists of titles, progress bars and warnings.

Where there is no terminal, lines on stderr take the place of the bars. Only the program itself
prints them, `tell_progress`, not a test that calls a command.
"""

import json
import shutil
import sys
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

from tqdm import tqdm

from ..core import jit, kernel_cache

WIDEST = 100        # columns of a line of progress
COMPILING = "compiling kernels: seconds to a minute, once per version"
FIRST, EVERY = 10.0, 60.0       # [s] of silence before the first line of progress, and the others


class Telling:
    """Hold whether lines of progress are printed, and whether compilation was announced."""

    active = False
    compiling = False


class Progress(tqdm):
    """A progress bar on terminals; elsewhere a line after some seconds, then one a minute."""

    def __init__(self, quiet=False, **line):
        super().__init__(disable=quiet or None, **line)
        self._tells = self.disable and not quiet
        self._unit, self._name = line.get("unit", "step"), line.get("desc") or ""
        self._next = monotonic() + FIRST

    def __iter__(self):
        """Yield the items, and count them."""
        if not self.disable:
            yield from super().__iter__()
            return
        for item in self.iterable:
            yield item
            self.update()

    def update(self, n=1):
        """Count n more."""
        if self.disable:
            self.n += n         # which tqdm does only where it shows a bar
        if self._tells and monotonic() > self._next:
            self._next = monotonic() + EVERY
            tell(f"{self._name}{': ' if self._name else ''}{self._count()}")
        return super().update(n)

    def _count(self):
        """Return what was counted as text, such as "run 4 of 9", or "15 s of 60 s, 3 runs" with
        the remark after a time.
        """
        if self._unit == "s":
            remark = getattr(self, "postfix", None)     # which tqdm sets late where it is disabled
            return f"{self.n:.0f} s of {self.total:g} s" + (f", {remark}" if remark else "")
        total = f" of {self.total:g}" if self.total else ""
        return f"{self._unit} {self.n:.4g}{total}"


def tell_progress():
    """Print lines of progress, and announce compilation, from here on."""
    Telling.active = True
    kernel_cache.compilations.append(announce_compilation)


def tell(sentence):
    """Print a line of progress on stderr."""
    if Telling.active:
        tqdm.write(f"mpm-ref: {sentence}", file=sys.stderr)


def announce_compilation():
    """Tell once that kernels are compiled."""
    if not Telling.compiling:
        Telling.compiling = True
        tell(COMPILING)


def announce_compilation_of_workers():
    """Tell that other processes, which print nothing, will compile, if no kernel is stored."""
    if jit.CACHE_DIR is None or not any(Path(jit.CACHE_DIR).glob("*.kernel")):
        announce_compilation()


def passing(quiet=False, **line):
    """Return a `Progress`, which shows nothing if quiet."""
    size = shutil.get_terminal_size((WIDEST, 24))
    return Progress(quiet, file=sys.stderr, ncols=min(size.columns, WIDEST), nrows=size.lines,
                    **line)         # tqdm shows nothing where they are unknown


@contextmanager
def compiling(quiet=False):
    """Show on a terminal that kernels are compiled while the block runs."""
    line = passing(quiet, desc=COMPILING, bar_format="{desc}", leave=False)
    Telling.compiling = Telling.compiling or quiet or not line.disable
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
    return json.dumps(finite(facts), indent=1)


def finite(value):
    """Return plain data with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value


def print_titles(titles, machine_readable):
    """Print {name: title}, a line each or as JSON."""
    lines = [f"{name:24} {title}" for name, title in titles.items()]
    print(as_json(titles) if machine_readable else "\n".join(lines))
