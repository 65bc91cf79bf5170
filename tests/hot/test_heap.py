"""Memory that is freed stays with the process."""

import os
import resource
import subprocess
import sys

import pytest

from mpm_ref.hot.heap import CHOSEN

FAULTS = """
import resource
import numpy as np
from mpm_ref.hot.heap import keep_freed_memory
kept = keep_freed_memory()
for k in range(3):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.empty(8_000_000).fill(1.0)
print(kept, resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def again(**variables):
    """Whether memory is kept, and the page faults of a block that is asked for a third time."""
    others = {name: value for name, value in os.environ.items() if name not in CHOSEN}
    done = subprocess.run([sys.executable, "-c", FAULTS], check=True, text=True,
                          capture_output=True, env={**others, "NUMPY_MADVISE_HUGEPAGE": "0",
                                                    **variables})
    kept, faults = done.stdout.split()
    return kept == "True", int(faults)


def test_freed_memory_is_used_again():
    kept, faults = again()
    if not kept:
        pytest.skip("the C library is not the GNU one")
    pages = 8 * 8_000_000 // resource.getpagesize()
    assert faults < 0.01 * pages


def test_choice_of_the_user_stays():
    kept, faults = again(MALLOC_TRIM_THRESHOLD_="131072")
    assert not kept
    assert faults > 8 * 8_000_000 // resource.getpagesize() // 2
