"""Write the results of a run frame by frame into one HDF5 file; no frame is ever half written.

The schema is in docs/reference/files.md. A frame is permanent once `Writer.append` returns, even if
the process is killed afterwards (see `journal`). `results` reads these files.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from ..body import restore_order
from ..streams import total_bodies
from .atomic import part_of, require_space
from .checksums import HEAD
from .journal import LIBVER, InUse, JournaledFile, in_use
from .manifest import scene_hash
from .results import CLOCK, ENERGIES, FORMAT, UNITS, USUAL, BadResults
from .text import counted, plain

ROWS = 1 << 16                    # particles per chunk


@dataclass(frozen=True)
class StoredFields:
    """The fields of particles that every frame stores, names of `UNITS`, and the gzip level (0-9).

    A body stores those that it has: J instead of F if it has only J, no C under PIC or FLIP.
    """

    names: tuple = USUAL
    gzip: int = 0

    def __post_init__(self):
        if "x" not in self.names or not set(self.names) <= set(UNITS):
            raise ValueError(f"fields {', '.join(self.names)}: expected x, "
                             f"and any of {', '.join(UNITS)}")
        if not 0 <= self.gzip <= 9:
            raise ValueError(f"gzip = {self.gzip}: expected a level from 0 (none) to 9")

    def select(self, body):
        """Return the stored fields of a body as {name: array}."""
        have = carried(body)
        names = ["J" if name == "F" and "J" in have else name for name in self.names]
        return {name: have[name] for name in names if name in have}


def carried(body):
    """Return the fields of a body as {name of `UNITS`: array (N, ..)}, in the current order."""
    q = body.particles
    have = {"J" if name == "F" and q.F.ndim == 1 else name: a for name, a in q._asdict().items()}
    return {name: a for name, a in have.items() if name in UNITS and len(a) == len(body.id)}


def create(path, problem, fields, facts, checkpoint=None):
    """Return the `Writer` of a new results file with the manifest `facts`, replacing one at `path`.

    The file `checkpoint`, of the results that are replaced, is removed first, so that a crash in
    between leaves no checkpoint of other results. An error before that changes neither file. Raises
    `InUse` while another process writes the file, `NotWritten`, or ValueError for names of bodies
    that HDF5 cannot distinguish.
    """
    path = Path(path)
    _require_names(problem.bodies)
    require_space(path, 0)
    file = _part_to_fill(path)
    try:
        if path.exists():
            JournaledFile(path).close()          # raises if it is being written
        with h5py.File(file, "w", libver=LIBVER, userblock_size=HEAD) as h5:
            _lay_out(h5, problem, fields)
            h5["manifest"] = json.dumps(facts, indent=1)
        file.commit()
        if checkpoint is not None:
            Path(checkpoint).unlink(missing_ok=True)
        file.move(path)
    except BaseException:
        part_of(path).unlink(missing_ok=True)    # before the lock is gone, and it another's
        file.close()
        raise
    return Writer(file)


def _part_to_fill(path):
    """Return a new locked file that will replace `path`; one of several writers gets it."""
    try:
        return JournaledFile(part_of(path), new=True, checked=True)
    except InUse:
        raise in_use(path) from None


def reopen(path, problem, frames):
    """Return a `Writer` that continues a results file after the first `frames` frames.

    Later frames are dropped. Raises `BadResults` if the file is of another scene or has fewer
    frames, `InUse`, `Damaged`, or OSError.
    """
    writer = Writer(JournaledFile(path, checked=True))
    try:
        require_run(writer.h5, path, problem, frames)
        writer.truncate(frames)
    except BaseException:
        writer.close()
        raise
    return writer


def require_run(h5, path, problem, frames):
    """Raise `BadResults` unless a results file is of the problem's scene and has these frames."""
    if h5.attrs["scene_sha256"] != scene_hash(problem):
        raise BadResults(f"{path} holds results of another scene; name another file, "
                         "or overwrite it")
    if len(h5["time"]) < frames:
        raise BadResults(f"{path} holds {counted(len(h5['time']), 'frame')}, but the checkpoint "
                         f"comes after {frames}; give the file of that run, or start the run anew")


class Writer:
    """Append frames to a results file; `create` and `reopen` return one, the caller closes it."""

    def __init__(self, file):
        self._file = file
        self.h5 = h5py.File(file, "r+", libver=LIBVER)

    def __len__(self):
        return len(self.h5["time"])

    def append(self, frame, energy):
        """Store a `Frame` and its `Energy`. Raises `NotWritten` and leaves the earlier frames."""
        rows = [(self.h5[name], value) for name, value in zip(
            (*CLOCK, "energy"), (frame.t, frame.dt, frame.state.step, energy), strict=True)]
        for body in frame.state.bodies:
            group = self.h5[f"bodies/{body.name}"]
            rows += [(group[name], restore_order(a, body.id, len(group["m"])))
                     for name, a in carried(body).items() if name in group]
        require_space(self.path, sum(np.asarray(row).nbytes for _, row in rows))
        for dataset, row in rows:
            _put(dataset, row)
        self._commit()

    @property
    def path(self):
        """Return the path of the file."""
        return self._file.path

    @property
    def last_step(self):
        """Return the number of steps at the last frame, None without a frame."""
        steps = self.h5["step"]
        return int(steps[-1]) if len(steps) else None

    @property
    def manifest(self):
        """Return the manifest as a dict."""
        return json.loads(self.h5["manifest"][()])

    def truncate(self, frames):
        """Drop all but the first `frames` frames."""
        for dataset in _per_frame(self.h5):
            dataset.resize(frames, axis=0)
        self._commit()

    def put_manifest(self, facts):
        """Replace the manifest by a dict of plain values."""
        del self.h5["manifest"]
        self.h5["manifest"] = json.dumps(facts, indent=1)
        self._commit()

    def close(self):
        """Close the file and release its lock."""
        self.h5.close()
        self._file.close()

    def _commit(self):
        self.h5.flush()
        self._file.commit()


def _put(dataset, value):
    """Append a row to a dataset."""
    n = len(dataset)
    dataset.resize(n + 1, axis=0)
    dataset[n] = value


def _lay_out(h5, problem, fields):
    """Write the constants of a run and create the empty series of its frames."""
    scheme = problem.scheme
    h5.attrs.update(format=FORMAT, scene_sha256=scene_hash(problem), title=problem.title,
                    dim=problem.dim, dx=problem.dx, gravity=np.array(problem.gravity, dtype=float),
                    degree=scheme.degree, transfer=scheme.transfer)
    if scheme.gimp:
        h5.attrs["gimp"] = scheme.gimp
    for name, (kind, unit) in CLOCK.items():
        _series(h5, name, (), kind, 0).attrs["unit"] = unit
    _series(h5, "energy", (len(ENERGIES),), "f8", 0).attrs.update(unit="J", columns=list(ENERGIES))
    for k, body in enumerate(total_bodies(problem)):
        group = h5.create_group(f"bodies/{body.name}")
        group.attrs.update(index=k, law=_json_text(body.law), flow=_json_text(body.flow))
        for name, unit in (("m", "kg"), ("V0", f"m^{problem.dim}")):
            a = restore_order(getattr(body.particles, name), body.id)
            group.create_dataset(name, data=a, fletcher32=a.size > 0).attrs["unit"] = unit
        for name, a in fields.select(body).items():
            _series(group, name, a.shape, "f8", fields.gzip).attrs["unit"] = UNITS[name]


def _series(group, name, shape, kind, gzip):
    """Create an empty dataset with a row of this shape per frame; short rows share a chunk."""
    rows = tuple(max(min(n, ROWS), 1) for n in shape[:1]) + shape[1:]
    return group.create_dataset(
        name, (0, *shape), kind, maxshape=(None, *shape),
        chunks=(64 if np.prod(shape) < 64 else 1, *rows),
        fletcher32=True, shuffle=gzip > 0, compression=gzip or None,
    )


def _per_frame(h5):
    """Return all datasets with a row per frame."""
    series = [h5[name] for name in (*CLOCK, "energy")]
    for group in h5["bodies"].values():
        series += [group[name] for name in UNITS if name in group]
    return series


def _json_text(record):
    """Return a NamedTuple of parameters as JSON."""
    return json.dumps(plain(record))


def _require_names(bodies):
    names = [body.name for body in bodies]
    bad = [name for name in names if name in ("", ".") or "/" in name or names.count(name) > 1]
    if bad:
        raise ValueError(f"body name {bad[0]!r}: expected names that differ and contain no '/'")
