"""Write the results of a run into one HDF5 file: frames stream into it, each completely or not.

The schema is in docs/reference/files.md. A frame stands once `Writer.append` returns, whatever
happens to the process afterwards (see `journal`). `results` reads the files.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from ..body import restore_order
from .atomic import part_of, require_space
from .journal import LIBVER, InUse, JournaledFile, in_use
from .manifest import scene_hash
from .results import CLOCK, ENERGIES, FORMAT, UNITS, USUAL, BadResults
from .words import counted, plain

ROWS = 1 << 16                    # particles per chunk


@dataclass(frozen=True)
class Fields:
    """What is stored of particles in every frame: names of `UNITS`; and the gzip level, 0 for none.

    A body stores what it carries: J instead of F where only J is carried, no C under PIC or FLIP.
    """

    names: tuple = USUAL
    gzip: int = 0

    def __post_init__(self):
        if "x" not in self.names or not set(self.names) <= set(UNITS):
            raise ValueError(f"fields {', '.join(self.names)}: expected x, "
                             f"and any of {', '.join(UNITS)}")
        if not 0 <= self.gzip <= 9:
            raise ValueError(f"gzip = {self.gzip}: expected a level from 0 (none) to 9")

    def of(self, body):
        """{name: array} of what is stored of a body."""
        have = carried(body)
        names = ["J" if name == "F" and "J" in have else name for name in self.names]
        return {name: have[name] for name in names if name in have}


def carried(body):
    """{name of `UNITS`: array (N, ..)} of what a body carries, particles in their current order."""
    q = body.particles
    have = {"J" if name == "F" and q.F.ndim == 1 else name: a for name, a in q._asdict().items()}
    return {name: a for name, a in have.items() if name in UNITS and len(a) == len(body.id)}


def create(path, problem, fields, facts, beside=None):
    """`Writer` of a new results file with the manifest `facts`, in place of what stood at `path`.

    The file `beside` belongs to what stood there: it goes first, so that a process killed in
    between leaves no pair that does not fit. A fault before then leaves both as they are.
    Raises `InUse` while another process writes it, `NotWritten`, or ValueError for names of bodies
    that HDF5 cannot tell apart.
    """
    path = Path(path)
    _require_names(problem.bodies)
    require_space(path, 0)
    file = _part_to_fill(path)
    try:
        if path.exists():
            JournaledFile(path).close()          # raises if it is being written
        with h5py.File(file, "w", libver=LIBVER) as h5:
            _lay_out(h5, problem, fields)
            h5["manifest"] = json.dumps(facts, indent=1)
        file.commit()
        if beside is not None:
            Path(beside).unlink(missing_ok=True)
        file.move(path)
    except BaseException:
        part_of(path).unlink(missing_ok=True)    # before the lock is gone, and it another's
        file.close()
        raise
    return Writer(file)


def _part_to_fill(path):
    """A new file beside `path`, locked until it takes that place: of several first writers one
    gets it.
    """
    try:
        return JournaledFile(part_of(path), new=True)
    except InUse:
        raise in_use(path) from None


def reopen(path, problem, frames):
    """`Writer` that goes on after the first so many frames of a results file, and drops the others.

    Raises `BadResults` if the file is of another scene or has fewer frames, `InUse`, or OSError.
    """
    writer = Writer(JournaledFile(path))
    try:
        require_run(writer.h5, path, problem, frames)
        writer.truncate(frames)
    except BaseException:
        writer.close()
        raise
    return writer


def require_run(h5, path, problem, frames):
    """Raise `BadResults` unless a results file is of the problem's scene and has so many frames."""
    if h5.attrs["scene_sha256"] != scene_hash(problem):
        raise BadResults(f"{path} holds results of another scene; name another file, "
                         "or overwrite it")
    if len(h5["time"]) < frames:
        raise BadResults(f"{path} holds {counted(len(h5['time']), 'frame')}, but the checkpoint "
                         f"comes after {frames}; give the file of that run, or start the run anew")


class Writer:
    """Appends frames to a results file; made by `create` and `reopen`, to be closed."""

    def __init__(self, file):
        self._file = file
        self.h5 = h5py.File(file, "r+", libver=LIBVER)

    def __len__(self):
        return len(self.h5["time"])

    def append(self, frame, energy):
        """Store a `Frame` and its `Energy`. Raises `NotWritten`; the frames before then stand."""
        rows = [(self.h5[name], value) for name, value in zip(
            (*CLOCK, "energy"), (frame.t, frame.dt, frame.state.step, energy), strict=True)]
        for body in frame.state.bodies:
            group = self.h5[f"bodies/{body.name}"]
            rows += [(group[name], restore_order(a, body.id))
                     for name, a in carried(body).items() if name in group]
        require_space(self.path, sum(np.asarray(row).nbytes for _, row in rows))
        for dataset, row in rows:
            _put(dataset, row)
        self._commit()

    @property
    def path(self):
        """Path of the file."""
        return self._file.path

    @property
    def last_step(self):
        """Steps made at the last frame, None without a frame."""
        steps = self.h5["step"]
        return int(steps[-1]) if len(steps) else None

    @property
    def manifest(self):
        """The manifest, a dict."""
        return json.loads(self.h5["manifest"][()])

    def truncate(self, frames):
        """Keep the first so many frames."""
        for dataset in _per_frame(self.h5):
            dataset.resize(frames, axis=0)
        self._commit()

    def put_manifest(self, facts):
        """Store the manifest (a dict of what JSON knows) in place of the one before."""
        del self.h5["manifest"]
        self.h5["manifest"] = json.dumps(facts, indent=1)
        self._commit()

    def close(self):
        """Close the file and let other writers have it."""
        self.h5.close()
        self._file.close()

    def _commit(self):
        self.h5.flush()
        self._file.commit()


def _put(dataset, value):
    """Append a row."""
    n = len(dataset)
    dataset.resize(n + 1, axis=0)
    dataset[n] = value


def _lay_out(h5, problem, fields):
    """Write what does not change, and the empty series of what does."""
    scheme = problem.scheme
    h5.attrs.update(format=FORMAT, scene_sha256=scene_hash(problem), title=problem.title,
                    dim=problem.dim, dx=problem.dx, gravity=np.array(problem.gravity, dtype=float),
                    degree=scheme.degree, transfer=scheme.transfer)
    for name, (kind, unit) in CLOCK.items():
        _series(h5, name, (), kind, 0).attrs["unit"] = unit
    _series(h5, "energy", (len(ENERGIES),), "f8", 0).attrs.update(unit="J", columns=list(ENERGIES))
    for k, body in enumerate(problem.bodies):
        group = h5.create_group(f"bodies/{body.name}")
        group.attrs.update(index=k, law=_in_words(body.law), flow=_in_words(body.flow))
        for name, unit in (("m", "kg"), ("V0", f"m^{problem.dim}")):
            a = restore_order(getattr(body.particles, name), body.id)
            group.create_dataset(name, data=a, fletcher32=a.size > 0).attrs["unit"] = unit
        for name, a in fields.of(body).items():
            _series(group, name, a.shape, "f8", fields.gzip).attrs["unit"] = UNITS[name]


def _series(group, name, shape, kind, gzip):
    """An empty dataset of one row of the given shape per frame; short rows share a chunk."""
    rows = tuple(max(min(n, ROWS), 1) for n in shape[:1]) + shape[1:]
    return group.create_dataset(
        name, (0, *shape), kind, maxshape=(None, *shape),
        chunks=(64 if np.prod(shape) < 64 else 1, *rows),
        fletcher32=True, shuffle=gzip > 0, compression=gzip or None,
    )


def _per_frame(h5):
    """All series of a file."""
    series = [h5[name] for name in (*CLOCK, "energy")]
    for group in h5["bodies"].values():
        series += [group[name] for name in UNITS if name in group]
    return series


def _in_words(record):
    """A NamedTuple of parameters as JSON."""
    return json.dumps(plain(record))


def _require_names(bodies):
    names = [body.name for body in bodies]
    bad = [name for name in names if name in ("", ".") or "/" in name or names.count(name) > 1]
    if bad:
        raise ValueError(f"body name {bad[0]!r}: expected names that differ and contain no '/'")
