"""One state, bit for bit, for any number of threads and any threading layer."""

import importlib.util

import pytest
from problems import digest, run_python, stepped, two_disks
from threads import by_threads

from mpm_ref.core.jit import set_threads
from mpm_ref.explicit import Scheme

STEPS, SORT = 100, 16
SHARED = {"MPM_REF_FEW_ITEMS": "0"}      # threads share loops over any number of items

CODE = f"""
import json, numba
from problems import digest, stepped, two_disks
sha = digest(stepped(two_disks(), {STEPS}, sort_every={SORT}))
print(json.dumps([sha, numba.threading_layer(), numba.get_num_threads()]))
"""

LOADS = """
from numba.np.ufunc.parallel import _launch_threads
try:
    _launch_threads()
    print("true")
except ValueError:
    print("false")
"""

LAYERS = [name for name, module in (("omp", "omppool"), ("workqueue", "workqueue"),
                                    ("tbb", "tbbpool"))
          if importlib.util.find_spec(f"numba.np.ufunc.{module}")]


def run():
    return digest(stepped(two_disks(), STEPS, sort_every=SORT))


@pytest.fixture(scope="module")
def here():
    return run()


def test_the_state_moves_on(here):
    """The digest sees a change in the last bit of one number, and 100 steps are not 99."""
    bodies = stepped(two_disks(), STEPS, sort_every=SORT)
    assert digest(bodies) == here
    bodies[1].particles.tau[3, 0, 1] *= 1 + 2.3e-16
    assert digest(bodies) != here
    assert digest(stepped(two_disks(), STEPS - 1, sort_every=SORT)) != here


def test_one_and_two_threads_give_the_same_bits(here):
    assert by_threads(run) == [here, here]


@pytest.mark.parametrize("transfer", ["apic", "mls"])
def test_relaxation_gives_the_same_bits_with_two_threads(transfer):
    def relaxed():
        scheme = Scheme(transfer=transfer, relaxation=2e-3)
        return digest(stepped(two_disks(scheme), STEPS, sort_every=SORT))

    one, two = by_threads(relaxed)
    assert one == two


def test_four_threads_give_the_same_bits(here):
    sha, _, threads = run_python(CODE, NUMBA_NUM_THREADS="4", **SHARED)
    assert threads == 4
    assert sha == here


@pytest.mark.parametrize("layer", LAYERS)
def test_every_threading_layer_gives_the_same_bits(here, layer):
    if layer == "tbb" and not run_python(LOADS, NUMBA_THREADING_LAYER=layer):
        pytest.skip("the tbb library is not installed")
    sha, used, _ = run_python(CODE, NUMBA_THREADING_LAYER=layer, **SHARED)
    assert used == layer
    assert sha == here


@pytest.mark.parametrize("n", [0, 10**6])
def test_impossible_numbers_of_threads_are_refused(n):
    with pytest.raises(ValueError, match=r"expected 1 \.\."):
        set_threads(n)
