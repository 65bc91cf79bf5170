"""Files of trained maps that are damaged, of the wrong sizes, or of another training."""

import tempfile
import zipfile
from pathlib import Path
from unittest.mock import patch

import numpy as np

from mpm_ref.rom.weights import arrays_of, load, sealed

from ..ldm import nets
from ..registry import experiment

NET, OTHERS = "gravity-r4", ("gravity-r7", "torsion-0", "poke")
BITS = 8
HEADER = 30         # bytes of an entry of a zip archive before its name
LENGTHS = slice(26, 30)     # where in these its lengths of name and extra field stand
OF_ARRAY = 128      # bytes before an array's numbers


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


def unfit(model):
    """Yield (class, what, bytes) of files with a seal that fits, and content that does not."""
    arrays = arrays_of(model)

    def put(name, k, value):
        found = arrays[name].copy()
        found.flat[k] = value
        return sealed({**arrays, name: found})

    for name in ("W", "b", "low", "span", "mean", "std", "xhat", "rest"):
        yield "not finite", f"{name} with NaN", put(name, 0, np.nan)
        yield "not finite", f"{name} with infinity", put(name, -1, np.inf)
        yield "wrong sizes", f"{name} shorter", sealed({**arrays, name: arrays[name][..., :-1]})
        yield "wrong sizes", f"{name} left out", sealed(
            {key: a for key, a in arrays.items() if key != name})
    for k in range(len(arrays["sizes"])):
        yield "wrong sizes", f"sizes[{k}] one more", put("sizes", k, arrays["sizes"][k] + 1)
    yield "wrong sizes", "of another format", put("format", 0, 99)
    for name in ("span", "std"):
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
    path, copy = nets.FOLDER / f"{NET}.npz", folder / f"{NET}.npz"

    def read(content, reader):
        copy.write_bytes(content)
        return refusal(reader, copy)

    count = run.choose(quick=2, standard=30)
    for group, made in (("damaged", damages(path, count, run.rng)), ("unfit", unfit(load(path)))):
        yield group, [(kind, what, *read(content, lambda: load(copy)))
                      for kind, what, content in made]
    with patch.object(nets, "FOLDER", folder):
        yield "other", [("of another training", name,
                         *read((path.parent / f"{name}.npz").read_bytes(),
                               lambda: nets.trained.__wrapped__(NET))) for name in OTHERS]


def refusal(read, path):
    """Whether reading a file ends in one clear sentence, and the sentence; "" if it was read."""
    try:
        read()
    except Exception as error:
        said = str(error)
        clear = isinstance(error, ValueError) and path.name in said and "\n" not in said
        return clear and any(word in said for word in (";", "python -m")), said
    return False, ""
