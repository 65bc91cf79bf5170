"""Check another code's implicit steps, here those of other_implicit.py, against a golden file.

Every step begins from the golden state: the end of the golden step before it.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
from other_implicit import step

from mpm_ref import oracle

GOLDEN = Path(__file__).with_name("golden_implicit.h5")
steps = []
with h5py.File(GOLDEN) as golden:
    dx, eps = golden.attrs["dx"], golden.attrs["eps"]
    state = {name: a[()] for name, a in golden["bodies/disk"].items()}
    for k in range(2):
        now = golden[f"steps/{k}"]
        given = {name: now[name][()] for name in ("nodes", "trial", "probe", "nodes1", "probe1")}
        steps.append(step(state, dx, now.attrs["dt"], given, eps))
        state |= {name: now[f"disk/{name}"][()] for name in "xvCF"}
with TemporaryDirectory() as folder:
    oracle.write(f"{folder}/other.h5", steps)
    print(oracle.check(GOLDEN, f"{folder}/other.h5"))
