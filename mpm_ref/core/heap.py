"""Memory that steps free and ask for again: matrices of implicit steps, and all that reduced steps
with many points compute of them.

By default the GNU C library returns large freed blocks to the operating system, which then clears
their pages anew at the next step (decisions 130 and 138 have times).
"""

import ctypes
import os

KEEP = {        # options of mallopt(3), and their values: no block outside of the heap, all is kept
    -4: 0,      # M_MMAP_MAX
    -1: -1,     # M_TRIM_THRESHOLD
}
CHOSEN = ("MALLOC_MMAP_MAX_", "MALLOC_TRIM_THRESHOLD_", "GLIBC_TUNABLES")    # by the user


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
    return all([mallopt(option, value) for option, value in KEEP.items()])
