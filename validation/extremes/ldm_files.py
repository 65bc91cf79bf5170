"""Refusal of files of maps that are damaged, of the wrong sizes, of another kind or training."""

import tempfile
import zipfile
from pathlib import Path
from unittest.mock import patch

import numpy as np

from mpm_ref.rom.fields.pod import basis
from mpm_ref.rom.fields.polynomial_manifold import curved
from mpm_ref.rom.model_file import Model, load, save
from mpm_ref.store.weights_file import SEAL, load_arrays, pack

from ..common.registry import experiment
from ..ldm import networks

LAWS = Path(__file__).parents[1] / "nclaw" / "weights"       # files of another kind
NET, OTHERS = "gravity-r4", ("gravity-r7", "torsion-0", "poke")
MODES, LEADING, POINTS, STATES = 4, 2, 40, 30       # of maps of modes, and of their snapshots
BITS = 8
HEADER = 30         # bytes of an entry of a zip archive before its name
LENGTHS = slice(26, 30)     # of these, the lengths of name and extra field
ARRAY_HEADER = 128      # bytes before an array's numbers


def mode_models(model, rng):
    """Return {kind: `Model`} fitted to a trained map's states at random points: POD modes, and a
    polynomial manifold over the leading ones.
    """
    field, latents = model.field, model.xhat.reshape(-1, model.field.r)
    X = field.units.low + field.units.span * rng.random((POINTS, field.dim))
    states = [field.derivatives(X, xhat) for xhat in latents[::len(latents) // STATES]]
    pod = basis(X, *(np.array(a) for a in tuple(zip(*states, strict=True))[:2]), MODES)
    xhat, rest = pod.xhat[None], np.zeros(MODES)
    return {"modes": Model(pod.modes, xhat, rest, {}),
            "curved": Model(curved(pod, LEADING, 2), xhat[..., :LEADING], rest[:LEADING], {})}


def byte_ranges(path):
    """Return {name: (begin, end)} of all bytes of a file of weights: the zip headers, the arrays'
    headers, their numbers, the archive's list of entries, and the seal.
    """
    size, ranges = path.stat().st_size, {}
    with zipfile.ZipFile(path) as archive:
        content = path.read_bytes()
        for entry in archive.infolist():
            begin = entry.header_offset
            lengths = np.frombuffer(content[begin:begin + HEADER][LENGTHS], "<u2")
            data = begin + HEADER + int(lengths.sum())
            ranges[f"{entry.filename}, zip header"] = (begin, data)
            ranges[f"{entry.filename}, header"] = (data, data + ARRAY_HEADER)
            ranges[f"{entry.filename}, numbers"] = (data + ARRAY_HEADER, data + entry.file_size)
        ranges["list of entries"] = (archive.start_dir, size - len(archive.comment))
        ranges["seal"] = (size - len(archive.comment), size)
    return ranges


def flip_bit(content, k, bit):
    """Return the bytes with a bit of byte k changed."""
    damaged = bytearray(content)
    damaged[k] ^= 1 << bit
    return bytes(damaged)


def damages(path, count, rng):
    """Yield (class, what, bytes): a bit flipped in every range of bytes, and the file cut there."""
    content = path.read_bytes()
    for name, (begin, end) in byte_ranges(path).items():
        for k in np.unique([begin, end - 1, *rng.integers(begin, end, count)]):
            yield name, f"bit of byte {k}", flip_bit(content, k, int(rng.integers(BITS)))
            yield name, f"cut at {k}", content[:k]


def with_other_seal(path, other):
    """Return (class, what, bytes) of a file with the seal of another one."""
    return "seal", f"that of {other.name}", path.read_bytes()[:-SEAL] + other.read_bytes()[-SEAL:]


def invalid_contents(arrays):
    """Yield (class, what, bytes) of files with a valid seal and invalid content."""

    def put(name, k, value):
        changed = arrays[name].copy()
        changed.flat[k] = value
        return pack({**arrays, name: changed})

    for name in (name for name, a in arrays.items() if a.ndim and name != "net.sizes"):
        if arrays[name].dtype.kind == "f":
            yield "not finite", f"{name} with NaN", put(name, 0, np.nan)
            yield "not finite", f"{name} with infinity", put(name, -1, np.inf)
        yield "wrong sizes", f"{name} shorter", pack({**arrays, name: arrays[name][..., :-1]})
        yield "wrong sizes", f"{name} left out", pack(
            {key: a for key, a in arrays.items() if key != name})
    for k, size in enumerate(arrays.get("net.sizes", ())):
        yield "wrong sizes", f"sizes[{k}] one more", put("net.sizes", k, size + 1)
    yield "wrong sizes", "of another format", put("format", 0, 99)
    for name in (name for name in ("units.span", "units.std") if name in arrays):
        yield "impossible", f"{name} with zero", put(name, 0, 0.0)


@experiment("extremes.ldm.files", title="LDM: damaged and mismatched files of weights",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 20})
def files(run):
    """Check that each is refused in one sentence that names the file and a remedy."""
    with tempfile.TemporaryDirectory() as folder:
        groups = [(title, *row) for title, rows in read_all(run, Path(folder)) for row in rows]
    for title in dict.fromkeys(row[0] for row in groups):
        rows = [row[1:] for row in groups if row[0] == title]
        record_refusals(run, f"extremes.ldm.files.{title}", rows, f"{len(rows)} files", folder)
    run.table("files", ("group", "kind", "what", "refused", "message"),
              [(*row[:-1], row[-1].replace(folder, "")) for row in groups])


def record_refusals(run, target, rows, scale, folder):
    """Record the share of refused files, rows (kind, what, whether it was refused, sentence)."""
    accepted = [f"{kind}: {what}: {message or 'accepted'}" for kind, what, ok, message in rows
                if not ok]
    run.record(target, 1.0 - len(accepted) / len(rows), paper=1.0, comparator="=", scale=scale,
               note="; ".join(("share refused in one sentence with the file's name and advice",
                               *accepted[:4])).replace(folder, ""))


def read_copies(cases, copy, read):
    """Write each of the cases (kind, what, bytes) to a copy and read it. Returns rows (kind, what,
    whether it was refused, the sentence).
    """
    rows = []
    for kind, what, content in cases:
        copy.write_bytes(content)
        rows.append((kind, what, *read_refusal(lambda: read(copy), copy)))
    return rows


def read_all(run, folder):
    """Yield (group, rows of `read_copies`) of all files, each written into a folder."""
    (folder / "copies").mkdir()
    copy, count = folder / "copies" / f"{NET}.npz", run.choose(quick=2, standard=30)
    files = write_models(folder, run.rng)

    def rows(name, cases, read=load):
        return read_copies(((kind, f"{name}: {what}", content) for kind, what, content in cases),
                           copy, read)

    for path in files:
        others = [other for other in files if other != path]
        yield "damaged", rows(path.stem, damages(path, count, run.rng))
        yield "damaged", rows(path.stem, (with_other_seal(path, other) for other in others))
        yield "unfit", rows(path.stem, invalid_contents(load_arrays(path)))
    yield "other", rows("laws", [("of another kind", path.stem, path.read_bytes())
                                 for path in sorted(LAWS.glob("*-neural.npz"))])
    trainings = [("of another training", name, (networks.FOLDER / f"{name}.npz").read_bytes())
                 for name in OTHERS]
    with patch.object(networks, "FOLDER", copy.parent):
        yield "other", rows(NET, trainings, lambda _: networks.trained.__wrapped__(NET))


def write_models(folder, rng):
    """Return the file of a trained map, and those of maps of modes, written into a folder."""
    net = networks.FOLDER / f"{NET}.npz"
    files = [net]
    for kind, model in mode_models(load(net), rng).items():
        files.append(folder / f"{kind}.npz")
        save(files[-1], model)
    return files


def read_refusal(read, path):
    """Return whether reading a file ends in one clear sentence, and the sentence; "" if it was
    read.
    """
    try:
        read()
    except Exception as error:
        message = str(error)
        clear = isinstance(error, ValueError) and path.name in message and "\n" not in message
        return clear and any(word in message for word in (";", "python -m")), message
    return False, ""
