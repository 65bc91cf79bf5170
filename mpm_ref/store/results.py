"""Read a results file, finished or not: frames, energies and quantities derived from fields.

The schema is in docs/reference/files.md. Particles are stored in the order in which their body was
sampled, so that row p is the same particle in every frame. `writer` writes these files.
"""

import json
from pathlib import Path

import h5py
import numpy as np

from .checksums import CheckedFile, Damaged, has_head
from .journal import recover
from .seal import CHECKPOINT, GOLDEN, is_sealed

FORMAT = "mpm_ref results 1"
UNITS = {                         # of what may be stored of particles in every frame
    "x": "m", "v": "m/s", "C": "1/s", "L": "1/s", "F": "1", "J": "1", "tau": "Pa", "y": "Pa",
}
USUAL = ("x", "v", "F", "tau")
CLOCK = {"time": ("f8", "s"), "dt": ("f8", "s"), "step": ("i8", "1")}
ENERGIES = ("kinetic", "elastic", "gravity")
SCALARS = {                       # name -> unit, what it is, and the fields it is computed from
    "speed": ("m/s", "magnitude of the velocity", ("v",)),
    "J": ("1", "volume ratio det F", ("F",)),
    "tau": ("Pa", "Frobenius norm of the Kirchhoff stress", ("tau",)),
    "pressure": ("Pa", "-tr(tau)/(d J), positive under compression", ("tau", "F")),
    "y": ("Pa", "yield stress, where a return map changes it", ("y",)),
    "body": ("1", "number of the body", ()),
}
OTHERS = {                        # other files of ours -> what they are
    CHECKPOINT: "a checkpoint, from which `mpm-ref run --resume` goes on",
    GOLDEN: "a golden file, for `mpm-ref oracle check`",
}


class BadResults(ValueError):
    """A file is not a results file that can be read, or continued."""


class Results:
    """A results file open for reading, as a context manager.

    Attributes: title, dim, dx [m], gravity (d,), degree, gimp; time and dt [s], step (frames,);
    energy (frames, 3) [J], see `ENERGIES`; bodies, their names; manifest, a dict. Raises
    `BadResults`.
    """

    def __init__(self, path):
        self.path = Path(path)
        if not self.path.is_file():
            what = "this is a folder" if self.path.is_dir() else "there is no such file"
            raise BadResults(f"{path}: {what}; expected a results file, as `mpm-ref run` writes it")
        recover(self.path)
        _require_head(self.path)
        try:
            self._file = CheckedFile(self.path)
        except Damaged as fault:
            raise _damaged(self.path, fault) from None
        try:
            self.h5 = h5py.File(self._file, "r")
            self._read_heads()
        except (OSError, RuntimeError, KeyError, ValueError) as fault:
            self._file.close()
            raise _damaged(self.path, fault) from fault

    def _read_heads(self):
        attrs = self.h5.attrs
        self.title, self.dx = attrs["title"], float(attrs["dx"])
        self.dim = int(attrs["dim"])
        self.gravity, self.degree = attrs["gravity"], int(attrs["degree"])
        self.gimp = float(attrs.get("gimp", 0.0))
        self.time, self.dt, self.step = (self.h5[name][()] for name in ("time", "dt", "step"))
        self.energy = self.h5["energy"][()]
        groups = self.h5["bodies"]
        self.bodies = sorted(groups, key=lambda name: groups[name].attrs["index"])
        self.manifest = json.loads(self.h5["manifest"][()]) if "manifest" in self.h5 else {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __len__(self):
        return len(self.time)

    def close(self):
        """Close the file."""
        self.h5.close()
        self._file.close()

    def index(self, frame):
        """Return the index of a frame; negative ones count from the end. Raises `BadResults`."""
        n = len(self)
        if not -n <= frame < n:
            raise BadResults(f"{self.path}: there is no frame {frame}; it has {n}, counted from 0")
        return frame % n

    def count(self, body):
        """Return the number of particles of a body, those included that enter or left."""
        return len(self.h5[f"bodies/{body}/m"])

    def present(self, body, frame):
        """Return which particles of a body (N,) are in the run at a frame: those with a
        position.
        """
        return ~np.isnan(self.field(body, "x", frame)).all(axis=1)

    def has(self, body, name):
        """Return whether a field of a body is stored."""
        return name in self.h5[f"bodies/{body}"]

    def fields(self, body):
        """Return the names of the fields of a body that every frame stores."""
        return [name for name in UNITS if self.has(body, name)]

    def gzip(self, body):
        """Return the gzip level of a body's fields, 0 for none."""
        return self.h5[f"bodies/{body}/x"].compression_opts or 0

    def field(self, body, name, frame=None):
        """Return a stored field of a body at a frame (N, ..), or at all frames (frames, N, ..).

        m and V0 (N,) do not depend on the frame. Raises `BadResults`.
        """
        if not self.has(body, name):
            stored = ", ".join(self.h5[f"bodies/{body}"])
            raise BadResults(f"{self.path}: {name} of body {body!r} is not stored; "
                             f"stored are {stored}")
        data = self.h5[f"bodies/{body}/{name}"]
        try:
            return data[()] if frame is None else data[self.index(frame)]
        except OSError as e:
            raise BadResults(f"{self.path}: {name} of body {body!r} is damaged ({_first_line(e)}); "
                             "other fields and frames may still be right") from e

    def offers(self, name):
        """Return whether every body stores the fields that an entry of `SCALARS` needs (J or F)."""
        return all(self.has(body, need) or (need == "F" and self.has(body, "J"))
                   for body in self.bodies for need in SCALARS[name][2])

    def scalar(self, body, name, frame):
        """Return an entry of `SCALARS`, one number per particle (N,).

        Raises `BadResults` if a field that it is computed from is not stored.
        """
        if name not in SCALARS:
            raise BadResults(f"field {name!r}: expected one of {', '.join(SCALARS)}")
        if name == "speed":
            return np.linalg.norm(self.field(body, "v", frame), axis=1)
        if name == "J":
            return self._volume_ratio(body, frame)
        if name == "tau":
            return self._norm(self.field(body, "tau", frame))
        if name == "pressure":
            mean = self._mean(self.field(body, "tau", frame))
            return -mean / self._volume_ratio(body, frame)
        if name == "y":
            return self.field(body, "y", frame)
        return np.full(self.count(body), float(self.bodies.index(body)))

    def _volume_ratio(self, body, frame):
        if self.has(body, "J"):
            return self.field(body, "J", frame)
        with np.errstate(invalid="ignore"):         # of particles that are not there
            return np.linalg.det(self.field(body, "F", frame))

    def _norm(self, tau):
        """Return |tau|; a fluid stores the isotropic value alone."""
        if tau.ndim == 1:
            return np.sqrt(self.dim) * np.abs(tau)
        return np.linalg.norm(tau, axis=(1, 2))

    def _mean(self, tau):
        """tr(tau)/d."""
        return tau if tau.ndim == 1 else np.trace(tau, axis1=1, axis2=2) / self.dim


def _require_head(path):
    """Raise `BadResults` for a file that does not begin as results do, unread by HDF5."""
    if has_head(path):
        return
    others = [what for kind, what in OTHERS.items() if is_sealed(path, kind)]
    if others or h5py.is_hdf5(path):
        raise BadResults(f"{path} is {others[0] if others else 'HDF5'}, but not a results file of "
                         f"mpm_ref (format {FORMAT!r}); give a file that `mpm-ref run` wrote")
    why = "it is empty" if path.stat().st_size == 0 else "it does not begin as one"
    raise BadResults(f"{path} cannot be read as HDF5 ({why}); expected a results file, as "
                     "`mpm-ref run` writes it: is it one, and whole?")


def _damaged(path, fault):
    """Return the `BadResults` about a damaged file."""
    return BadResults(f"{path} is damaged ({_first_line(fault)}); take a copy, or make it again")


def _first_line(error):
    """Return the first line of one of HDF5's long messages."""
    return str(error).splitlines()[0]
