"""Check another code's gradients, here those of other_gradients.py, against a golden file.

Every step is differentiated by itself: it begins from the golden state, and from the seeds that the
golden file has for it.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
from other_gradients import pull_back

from mpm_ref import oracle

GOLDEN = Path(__file__).with_name("golden_adjoint.h5")
steps = []
with h5py.File(GOLDEN) as golden:
    state = {name: a[()] for name, a in golden["bodies/disk"].items()}
    for now in golden["steps"].values():
        seed = {name: now[f"disk/{name}_seed"][()] for name in "xvCF"}
        steps.append(pull_back(state, seed, golden.attrs["dx"], now.attrs["dt"]))
        state |= {name: now[f"disk/{name}"][()] for name in "xvCF"}
with TemporaryDirectory() as folder:
    oracle.write(f"{folder}/other.h5", steps)
    print(oracle.check(GOLDEN, f"{folder}/other.h5"))
