"""One number of one experiment, as it is stored: `results/<profile>/<id>.json` lists them.

No verdict is stored. A printed number is judged by the rule in `validation/targets`, a check of our
own by the rule that its experiment recorded; both when records are read (see `verdicts`).
"""

import hashlib
from pathlib import Path

import msgspec

from mpm_ref.store.atomic import write_bytes

from .judge import Bound

PRINTED = "printed"     # stands where the rule is that of the printed number


class Origin(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Source and machine of a file's records; the first record has it."""

    digest: str = ""                    # of the source that made them: see `source_digest`
    seal: str = ""                      # of records and tables: see `seal_of`
    cpu: str = ""
    memory_gb: float = 0.0
    threads: int = 1
    system: str = ""
    blas: str = ""
    torch: str = ""                     # its version, where the experiment imported it
    load: tuple[float, float] = (0.0, 0.0)      # average of a minute, before and after
    others: float | None = None         # cores that other processes kept busy, in the mean
    inputs: dict[str, str] = {}         # hashes of the data files: see `input_files`


class Measurement(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A value, and the rule by which it is judged unless the number is printed."""

    target: str                     # id of the number, of the paper's target where there is one
    value: int | float | None       # ours; None where the run gave no finite number
    unit: str
    scale: str                      # at which size it was run, against the paper's
    seconds: float                  # wall time of the whole experiment
    seed: int
    command: str
    commit: str
    date: str
    cores: int
    comparator: str = PRINTED       # of a check of our own
    paper: int | float | None = None    # the value that such a check expects
    bound: Bound | None = None          # end or ends of the interval that such a check accepts
    note: str = ""
    cpu_seconds: float = 0.0
    versions: dict[str, str] = {}
    workers: int = 1                # experiments that shared the cores
    scatter: float | None = None    # relative, of another run; see `recheck`
    origin: Origin | None = None


def write_records(path, records):
    """Write a list of `Measurement`s as readable JSON."""
    write_whole(path, encoded(records))


def encoded(records):
    """Return the readable JSON of a list of `Measurement`s."""
    return msgspec.json.format(msgspec.json.encode(records), indent=1) + b"\n"


def read_records(path):
    """Read the records of a file. Raises ValueError with the file and the wrong field."""
    try:
        records = msgspec.json.decode(Path(path).read_bytes(), type=list[Measurement])
    except msgspec.DecodeError as error:
        raise ValueError(f"{path} is not a list of records: {error}; run the experiment again") \
            from error
    if not records:
        raise ValueError(f"{path} has no record; run the experiment again")
    return records


def sealed(records, tables):
    """Return the records, as they are read again, with the seal of all their content and of {name:
    bytes} of the tables.
    """
    first, *others = msgspec.json.decode(encoded(records), type=list[Measurement])
    origin = first.origin or Origin()
    seal = seal_of([first, *others], tables)
    return [msgspec.structs.replace(first, origin=msgspec.structs.replace(origin, seal=seal)),
            *others]


def seal_of(records, tables):
    """Return the hash of records, but for their seal, and of {name: bytes} of their tables."""
    first, *others = records
    if first.origin:
        unsealed = msgspec.structs.replace(first.origin, seal="")
        first = msgspec.structs.replace(first, origin=unsealed)
    content = hashlib.sha256(msgspec.json.encode([first, *others]))
    for name, table in sorted(tables.items()):
        content.update(f"\n{name}\n".encode())
        content.update(table)
    return content.hexdigest()


def write_whole(path, content):
    """Write bytes so that a reader, or a crash, sees the old file or the new one, never a part."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, content)
