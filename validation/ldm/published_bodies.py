"""Points of bodies that experiments keep for figures, small enough to be published."""

import io

import numpy as np

from ..common.record import write_whole

BITS = 14                   # of a kept coordinate, after that of the largest


def keep(run, **arrays):
    """Write named arrays of an experiment, floats rounded and in single precision."""
    text = io.BytesIO()
    np.savez_compressed(text, **{name: rounded(np.asarray(a)) for name, a in arrays.items()})
    write_whole(file_of(run.folder, run.experiment.id), text.getvalue())


def rounded(a):
    """Return floats rounded to `BITS` bits, since trailing zeros compress well; NaN and integers
    stay.
    """
    if a.dtype.kind != "f":
        return a
    largest = np.max(np.abs(a), initial=0.0, where=np.isfinite(a))
    unit = 2.0 ** (np.floor(np.log2(largest)) - BITS) if largest else 1.0
    return (np.round(a / unit) * unit).astype(np.float32)


def read(folder, experiment_id):
    """Return {name: array} of an experiment. Raises FileNotFoundError where they are not there."""
    file = file_of(folder, experiment_id)
    if not file.is_file():
        raise FileNotFoundError(f"no {file.name} in {file.parent}: run {experiment_id} again")
    with np.load(file) as arrays:
        return {name: arrays[name] for name in arrays.files}


def file_of(folder, experiment_id):
    """Return the path of an experiment's arrays: ``results/<profile>/bodies/<id>.npz``."""
    return folder / "bodies" / f"{experiment_id}.npz"
