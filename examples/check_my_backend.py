"""Check another code's arrays, here those of other_code.py, against a golden file."""

import h5py
from other_code import step

from mpm_ref import oracle

with h5py.File("examples/golden.h5") as golden:
    state = {name: a[()] for name, a in golden["bodies/disk"].items()}
    dx, dts = golden.attrs["dx"], [golden[f"steps/{k}"].attrs["dt"] for k in range(3)]
oracle.write("other.h5", [step(state, dx, dt) for dt in dts])
print(oracle.check("examples/golden.h5", "other.h5"))
