"""One computation with one thread and with two, to compare the bits."""

import numba

from mpm_ref.core.jit import set_threads

MOST = numba.config.NUMBA_NUM_THREADS


def by_threads(compute):
    """What compute() returns with one thread and with two, or twice with one on a single core."""
    before, results = numba.get_num_threads(), []
    try:
        for threads in (1, min(2, MOST)):
            set_threads(threads)
            results.append(compute())
    finally:
        set_threads(before)
    return results
