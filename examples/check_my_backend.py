"""Check another code's arrays, here those of other_code.py, against a golden file."""

from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
from other_code import step

from mpm_ref import oracle

GOLDEN = Path(__file__).with_name("golden.h5")
with h5py.File(GOLDEN) as golden:
    state = {name: a[()] for name, a in golden["bodies/disk"].items()}
    dx, dts = golden.attrs["dx"], [golden[f"steps/{k}"].attrs["dt"] for k in range(3)]
with TemporaryDirectory() as folder:
    oracle.write(f"{folder}/other.h5", [step(state, dx, dt) for dt in dts])
    print(oracle.check(GOLDEN, f"{folder}/other.h5"))
