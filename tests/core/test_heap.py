"""Memory that is freed stays with the process."""

import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from mpm_ref.core.heap import CHOSEN
from mpm_ref.explicit import Scheme
from mpm_ref.hot import step

FAULTS = """
import ctypes, resource
import numpy as np
from mpm_ref.core.heap import keep_freed_memory
ctypes.CDLL(None).prctl(41, 1, 0, 0, 0)         # PR_SET_THP_DISABLE: small pages, to be counted
kept = keep_freed_memory()
for k in range(3):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.empty(8_000_000).fill(1.0)
print(kept, resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
gnu = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")


def again(**variables):
    """Whether memory is kept, and the page faults of a block that is asked for a third time."""
    others = {name: value for name, value in os.environ.items() if name not in CHOSEN}
    done = subprocess.run([sys.executable, "-c", FAULTS], check=True, text=True,
                          capture_output=True, env={**others, "NUMPY_MADVISE_HUGEPAGE": "0",
                                                    **variables})
    kept, faults = done.stdout.split()
    return kept == "True", int(faults)


@gnu
def test_freed_memory_is_used_again():
    kept, faults = again()
    assert kept
    assert faults < 100


@gnu
@pytest.mark.parametrize("variables", [{"MALLOC_TRIM_THRESHOLD_": "131072"},
                                       {"GLIBC_TUNABLES": "glibc.malloc.trim_threshold=131072"}])
def test_choice_of_the_user_stays(variables):
    kept, faults = again(**variables)
    assert not kept
    assert faults > 1000


def test_an_implicit_run_asks_for_it(monkeypatch):
    asked = []
    monkeypatch.setattr(step, "keep_freed_memory", lambda: asked.append(True))
    step.ImplicitStepper(Scheme(transfer="apic"), 0.1, 2, np.zeros(2)).start(())
    assert asked == [True]
