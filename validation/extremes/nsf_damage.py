"""Fields of modes of which a single number is damaged, in memory and in their file: what is
noticed, and what a run makes of the rest.
"""

import tempfile
from pathlib import Path

import numpy as np

from mpm_ref.rom import model_file
from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.model_file import Model
from mpm_ref.store.weights_file import load_arrays

from ..common.registry import experiment
from ..nsf.reduced_runs import refit
from .ldm_files import damages, flipped, refusal, unfit
from .ldm_runs import FINE, SILENT, record_silent, table_of
from .nsf_runs import ERRORS, Bench, scenes

HUGE = 1e30
SMALL = 8, 8, 8     # modes of each field whose files are damaged: hundreds of files are made
BITS = {"lowest bit": 0, "highest bit of the fraction": 51, "lowest bit of the exponent": 52,
        "highest bit of the exponent": 62, "sign": 63}     # of a double
ARRAYS = ("U", "bend.w", "tau.modes", "tau.coefficients.w", "tau.coefficients.centers", "C.modes",
          "C.coefficients.w")
SHOWN = {"quick": ("tau.modes", "tau.coefficients.w"), "standard": ARRAYS}
FILED = "metal"     # the scene of whose fields there are damaged files
KINDS = {"quick": ("NaN", "huge", "lowest bit of the exponent"),
         "standard": ("NaN", "huge", "zero", *BITS)}


def spoilt(value, kind):
    """A number damaged in one of KINDS."""
    plain = {"NaN": np.nan, "huge": HUGE, "zero": 0.0}
    if kind in plain:
        return plain[kind]
    bit, a = BITS[kind], np.float64(value).tobytes()
    return float(np.frombuffer(flipped(a, bit // 8, bit % 8))[0])


def damaged(record, path, at, kind):
    """Nested records with entry `at`, a share of all of them in [0, 1), of the array at a path such
    as "tau.coefficients.w" damaged.
    """
    name, _, rest = path.partition(".")
    inner = getattr(record, name)
    if rest:
        return record._replace(**{name: damaged(inner, rest, at, kind)})
    found, k = inner.copy(), int(at * inner.size)
    found.flat[k] = spoilt(found.flat[k], kind)
    return record._replace(**{name: found})


@experiment("extremes.nsf.damage", title="NSF: damaged fields, in memory and as files",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 280})
def damage(run):
    """A damaged number may do no harm, be noticed, or be silent; a damaged file must be refused."""
    found = []
    for name, one in scenes(run):
        bench = Bench(name, one)
        cases = [(path, kind) for path in SHOWN[run.profile] for kind in KINDS[run.profile]]
        found += [bench.trial(f"{path}: {kind}", bench.drawn(bench.count), damaged(
            one.fields, path, run.rng.random(), kind))
            for path, kind in run.progress(cases, f"{name}, damages")]
        if name == FILED:
            record_files(run, name, refit(one, Sizes(one.fields.r, *SMALL), follows=True))
    record_ends(run, found)
    record_silent(run, "extremes.nsf.damage", found, ERRORS)
    table_of(run, found)


def record_ends(run, trials):
    """Record how runs ended by the kind of damage."""
    for kind in KINDS[run.profile]:
        own = [t for t in trials if t.what.endswith(f": {kind}")]
        passed = [t for t in own if t.kind in (FINE, SILENT)]
        worst = max(passed, key=lambda t: t.end.error / t.usual, default=None)
        words = "none passed" if worst is None else (
            f"largest error of those that passed {worst.end.error:.3g} %, {worst.map}, "
            f"{worst.what}, usual {worst.usual:.3g} %")
        run.record(f"extremes.nsf.damage.{kind.replace(' ', '-')}", 1.0 - len(passed) / len(own),
                   comparator="info", scale=f"{len(own)} runs with one damaged number, {ERRORS}",
                   note=f"share flagged or stopped; {words}")


def record_files(run, name, one):
    """Record whether damaged and unfit files of a scene's fields are refused, which have a
    parameter, so that no array is empty.
    """
    count = run.choose(quick=1, standard=10)
    with tempfile.TemporaryDirectory() as folder:
        path, copy = Path(folder) / "fields.npz", Path(folder) / "copy.npz"
        model_file.save(path, Model(one.fields, one.xhat, one.xhat[0, 0], {}))
        made = {"damaged": damages(path, count, run.rng), "unfit": unfit(load_arrays(path))}
        for group, files in made.items():
            rows = []
            for kind, what, content in files:
                copy.write_bytes(content)
                rows.append((kind, what, *refusal(lambda: model_file.load(copy), copy)))
            taken = [f"{kind}: {what}: {said or 'accepted'}" for kind, what, ok, said in rows
                     if not ok]
            run.record(f"extremes.nsf.damage.files.{group}", 1.0 - len(taken) / len(rows),
                       paper=1.0, comparator="=", scale=f"{len(rows)} files of {name}'s fields",
                       note="; ".join(("share refused in one sentence with the file's name and "
                                       "advice", *taken[:4])).replace(folder, ""))
