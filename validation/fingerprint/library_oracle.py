"""Calls of mpm_ref's golden files, for `oracle`; see `library`."""

from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np

from mpm_ref.oracle import record, record_adjoint

WRITE = {"steps": record, "adjoint": record_adjoint}
TIMES = "cpu_times"     # of a solver's report: the only values of a golden file that are no results


def golden(kind, problem, steps):
    """Return {path in the file: array} of a golden file of some steps, or of their adjoint."""
    values = {}

    def put(name, item):
        for key, value in item.attrs.items():
            put_numbers(values, f"{name} {key}", np.asarray(value))
        if isinstance(item, h5py.Dataset):
            put_numbers(values, name, item[()])

    with TemporaryDirectory() as folder:
        path = Path(folder) / "golden.h5"
        WRITE[kind](problem, path, steps)
        with h5py.File(path) as file:
            file.visititems(put)
    return values


def put_numbers(values, name, value):
    """Add a value to `values` if it consists of numbers, times left out."""
    if np.asarray(value).dtype.kind in "bif" and not name.endswith(TIMES):
        values[name] = np.asarray(value)
