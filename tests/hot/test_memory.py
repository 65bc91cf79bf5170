"""Memory of implicit steps: what a solve allocates is freed when it ends, without the collector."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
STEPS, WARM = 1000, 100     # steps in all; those before the first measurement
GROWTH = 2e6                # [bytes]; 0.7e6 measured, 109e6 with every hierarchy in a cycle
PROGRAM = f"""
import gc
import sys

import numpy as np

sys.path[:0] = [{str(ROOT / "tests/support")!r}]
from hot_steps import DT, stepper_of
from mpm_ref.hot.methods import options_of
from mpm_ref.store.manifest import peak_memory

stepper, bodies = stepper_of(2, 6, options_of("hot"))
gc.disable()
iterations = 0
for k in range({STEPS}):
    if k == {WARM}:
        before, iterations = peak_memory(), 0
    stepper.step(bodies, k * DT / 10, DT / 10)
    iterations += stepper.report.iterations
print(peak_memory() - before, iterations)
"""


def test_memory_stays_flat_over_a_thousand_steps():
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=ROOT, check=True,
                          capture_output=True, text=True)
    grown, iterations = map(int, done.stdout.split())
    assert iterations >= STEPS - WARM       # hierarchies were built
    assert grown < GROWTH, f"{grown / (STEPS - WARM):.0f} bytes a step"
