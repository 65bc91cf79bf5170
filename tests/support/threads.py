"""One computation with one thread and with two, to compare the bits."""

import numba

from mpm_ref.core import jit
from mpm_ref.core.jit import set_threads

MOST = numba.config.NUMBA_NUM_THREADS


def by_threads(compute):
    """What compute() returns with one thread and with two, or twice with one on a single core; two
    threads share any number of items.
    """
    before, few, results = numba.get_num_threads(), jit.few_items, []
    jit.few_items = 0
    try:
        for threads in (1, min(2, MOST)):
            set_threads(threads)
            results.append(compute())
    finally:
        set_threads(before)
        jit.few_items = few
    return results
