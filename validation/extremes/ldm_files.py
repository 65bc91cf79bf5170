"""Files of maps that are damaged, of the wrong sizes, of another kind or of another training."""

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
MODES, BENT, POINTS, STATES = 4, 2, 40, 30      # of maps of modes: all, those that lead; and what
                                                # they are made of
BITS = 8
HEADER = 30         # bytes of an entry of a zip archive before its name
LENGTHS = slice(26, 30)     # where in these its lengths of name and extra field stand
OF_ARRAY = 128      # bytes before an array's numbers


def of_modes(model, rng):
    """{kind: `Model` of modes} of a trained map's states at random points: straight ones, and
    curved ones with a part of the coordinates.
    """
    map, latents = model.field, model.xhat.reshape(-1, model.field.r)
    X = map.units.low + map.units.span * rng.random((POINTS, map.dim))
    found = [map.derivatives(X, xhat) for xhat in latents[::len(latents) // STATES]]
    known = basis(X, *(np.array(a) for a in tuple(zip(*found, strict=True))[:2]), MODES)
    xhat, rest = known.xhat[None], np.zeros(MODES)
    return {"modes": Model(known.modes, xhat, rest, {}),
            "curved": Model(curved(known, BENT, 2), xhat[..., :BENT], rest[:BENT], {})}


def classes(path):
    """{name: (begin, end)} of the bytes of a file of weights, whole: the zip headers, the arrays'
    own headers, their numbers, the archive's list of entries, and the seal.
    """
    size, found = path.stat().st_size, {}
    with zipfile.ZipFile(path) as archive:
        content = path.read_bytes()
        for entry in archive.infolist():
            begin = entry.header_offset
            lengths = np.frombuffer(content[begin:begin + HEADER][LENGTHS], "<u2")
            data = begin + HEADER + int(lengths.sum())
            found[f"{entry.filename}, zip header"] = (begin, data)
            found[f"{entry.filename}, header"] = (data, data + OF_ARRAY)
            found[f"{entry.filename}, numbers"] = (data + OF_ARRAY, data + entry.file_size)
        found["list of entries"] = (archive.start_dir, size - len(archive.comment))
        found["seal"] = (size - len(archive.comment), size)
    return found


def flipped(content, k, bit):
    """The bytes with a bit of byte k changed."""
    damaged = bytearray(content)
    damaged[k] ^= 1 << bit
    return bytes(damaged)


def damages(path, count, rng):
    """Yield (class, what, bytes): bits flipped in every class of bytes, and the file cut there."""
    content = path.read_bytes()
    for name, (begin, end) in classes(path).items():
        for k in np.unique([begin, end - 1, *rng.integers(begin, end, count)]):
            yield name, f"bit of byte {k}", flipped(content, k, int(rng.integers(BITS)))
            yield name, f"cut at {k}", content[:k]


def resealed(path, other):
    """(class, what, bytes) of a file with the seal of another one."""
    return "seal", f"that of {other.name}", path.read_bytes()[:-SEAL] + other.read_bytes()[-SEAL:]


def unfit(arrays):
    """Yield (class, what, bytes) of files with a seal that fits, and content that does not."""

    def put(name, k, value):
        found = arrays[name].copy()
        found.flat[k] = value
        return pack({**arrays, name: found})

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
    """Each must be refused in one sentence that names the file and what to do."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [(title, *row) for title, found in tried(run, Path(folder)) for row in found]
    for title in dict.fromkeys(row[0] for row in rows):
        own = [row[1:] for row in rows if row[0] == title]
        taken = [f"{kind}: {what}: {said or 'accepted'}" for kind, what, ok, said in own if not ok]
        run.record(f"extremes.ldm.files.{title}", 1.0 - len(taken) / len(own), paper=1.0,
                   comparator="=", scale=f"{len(own)} files",
                   note="; ".join(("share refused in one sentence with the file's name and advice",
                                   *taken[:4])))
    run.table("files", ("group", "kind", "what", "refused", "said"),
              [(*row[:-1], row[-1].replace(folder, "")) for row in rows])


def tried(run, folder):
    """Yield (group, rows (kind, what, whether it was refused, the sentence)) of all files, each
    written into a folder.
    """
    (folder / "copies").mkdir()
    copy, count = folder / "copies" / f"{NET}.npz", run.choose(quick=2, standard=30)
    files = written(folder, run.rng)

    def rows(name, made, read=load):
        found = []
        for kind, what, content in made:
            copy.write_bytes(content)
            found.append((kind, f"{name}: {what}", *refusal(lambda: read(copy), copy)))
        return found

    for path in files:
        others = [other for other in files if other != path]
        yield "damaged", rows(path.stem, damages(path, count, run.rng))
        yield "damaged", rows(path.stem, (resealed(path, other) for other in others))
        yield "unfit", rows(path.stem, unfit(load_arrays(path)))
    yield "other", rows("laws", [("of another kind", path.stem, path.read_bytes())
                                 for path in sorted(LAWS.glob("*-neural.npz"))])
    trainings = [("of another training", name, (networks.FOLDER / f"{name}.npz").read_bytes())
                 for name in OTHERS]
    with patch.object(networks, "FOLDER", copy.parent):
        yield "other", rows(NET, trainings, lambda _: networks.trained.__wrapped__(NET))


def written(folder, rng):
    """Return the files of a trained map, and of maps of modes that are written into a folder."""
    net = networks.FOLDER / f"{NET}.npz"
    files = [net]
    for kind, model in of_modes(load(net), rng).items():
        files.append(folder / f"{kind}.npz")
        save(files[-1], model)
    return files


def refusal(read, path):
    """Whether reading a file ends in one clear sentence, and the sentence; "" if it was read."""
    try:
        read()
    except Exception as error:
        said = str(error)
        clear = isinstance(error, ValueError) and path.name in said and "\n" not in said
        return clear and any(word in said for word in (";", "python -m")), said
    return False, ""
