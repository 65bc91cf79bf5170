"""The laws of a small training after some of its epochs, in one file.

Networks are trained in single precision, and stored so: they come back as they were, as doubles.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from mpm_ref.materials.learned.weights import (
    PARTS,
    LearnedLaws,
    fault_of,
    law_arrays,
    law_from_arrays,
)
from mpm_ref.store.atomic import write_bytes
from mpm_ref.store.weights_file import (
    header,
    load_arrays,
    pack,
    read_provenance,
    require_format,
)

FORMAT = 1


class Bundle(NamedTuple):
    """Laws by epoch, and what is known of their training."""

    laws: dict          # {epochs over: `LearnedLaws`}, each with an about
    about: dict         # plain values


def save(path, bundle):
    """Write a `Bundle`, whole or not at all. Raises ValueError for weights that single precision
    does not hold and an `about` with more than JSON knows, OSError where the system refuses.
    """
    about = {**bundle.about, "laws": {str(epoch): laws.about for epoch, laws in
                                      bundle.laws.items()}}
    arrays = header(path, FORMAT, about)
    for epoch, laws in bundle.laws.items():
        for part in PARTS:
            for name, a in law_arrays(part, getattr(laws, part)).items():
                arrays[f"{epoch}.{name}"] = single(path, name, a)
    write_bytes(path, pack(arrays))


def single(path, name, a):
    """An array of a law as it is stored: weights in single precision, all else as it is."""
    if a.dtype != float or name.endswith("_constants"):
        return a
    short = a.astype(np.float32)
    if not np.array_equal(short, a):
        raise ValueError(f"{path} is not written: {name} has more digits than single precision; "
                         "store such laws with mpm_ref.materials.learned.weights")
    return short


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    arrays = load_arrays(Path(path))
    require_format(path, arrays, FORMAT, "laws of a small training")
    about = read_provenance(path, arrays)
    own = about.pop("laws", {})
    epochs = sorted(own, key=int)
    return Bundle({int(k): laws_of(path, arrays, k, own[k]) for k in epochs}, about)


def laws_of(path, arrays, epoch, about):
    """`LearnedLaws` of an epoch."""
    start = f"{epoch}."
    own = {name.removeprefix(start): a.astype(float) if a.dtype == np.float32 else a
           for name, a in arrays.items() if name.startswith(start)}
    fault = fault_of(own)
    if fault:
        raise ValueError(f"{path} holds no trained laws of epoch {epoch}: {fault}; train again")
    return LearnedLaws(*(law_from_arrays(part, own) for part in PARTS), about)
