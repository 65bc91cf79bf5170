"""Memory that implicit steps free and ask for again: matrices of hundreds of megabytes.

By default the GNU C library returns large freed blocks to the operating system, which then clears
their pages anew at the next step: 8 to 15 % of the time of a step in two scenes of 115 000 and
400 000 particles, 13 to 24 % by two threads.
"""

import ctypes
import os

ALWAYS = {      # options of mallopt(3), and their values: no block outside of the heap, all is kept
    -4: 0,      # M_MMAP_MAX
    -1: -1,     # M_TRIM_THRESHOLD
}
CHOSEN = ("MALLOC_MMAP_MAX_", "MALLOC_TRIM_THRESHOLD_")     # by the user, for the whole process


def keep_freed_memory():
    """Make the C library keep memory that is freed, for the process; return whether it does.

    It is not asked where a variable of `CHOSEN` is set, and where it is not the GNU one.
    """
    if any(name in os.environ for name in CHOSEN):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, TypeError, AttributeError):
        return False
    return all([mallopt(option, value) for option, value in ALWAYS.items()])
