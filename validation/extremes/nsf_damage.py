"""Fields of modes with a single damaged number, in memory and in their file: which damage the seal
of the arrays, the monitor or the reader notices, and the errors of runs with the rest.

Each damaged run is judged twice: as a run of the program is, which compares the arrays with their
seal (`rom.integrity`) and stops, and without the seal, by its states alone.
"""

import tempfile
from pathlib import Path

import numpy as np

from mpm_ref.rom import model_file
from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.integrity import damaged_arrays
from mpm_ref.rom.model_file import Model
from mpm_ref.store.weights_file import load_arrays

from ..common.registry import experiment
from ..nsf.reduced_runs import refit
from .ldm_files import (
    damages,
    flip_bit,
    invalid_contents,
    read_copies,
    record_refusals,
)
from .ldm_runs import record_silent
from .nsf_runs import ERRORS, FieldBench, scenes
from .verdicts import FINE, SILENT, trial_table

HUGE = 1e30
SMALL = 8, 8, 8     # modes of each field for the hundreds of damaged files
BITS = {"lowest bit": 0, "highest bit of the fraction": 51, "lowest bit of the exponent": 52,
        "highest bit of the exponent": 62, "sign": 63}     # of a double
ARRAYS = ("U", "bend.w", "tau.modes", "tau.coefficients.w", "tau.coefficients.centers", "C.modes",
          "C.coefficients.w")
SHOWN = {"quick": ("tau.modes", "tau.coefficients.w"), "standard": ARRAYS}
FILE_SCENE = "metal"    # the scene whose fields are stored in damaged files
KINDS = {"quick": ("NaN", "huge", "lowest bit of the exponent"),
         "standard": ("NaN", "huge", "zero", *BITS)}


def damage_number(value, kind):
    """Return a number damaged in one of KINDS."""
    plain = {"NaN": np.nan, "huge": HUGE, "zero": 0.0}
    if kind in plain:
        return plain[kind]
    bit, a = BITS[kind], np.float64(value).tobytes()
    return float(np.frombuffer(flip_bit(a, bit // 8, bit % 8))[0])


def damage_array(record, path, share, kind):
    """Return nested records with one entry damaged of the array at a path such as
    "tau.coefficients.w": the entry at a share in [0, 1) of all of them.
    """
    name, _, rest = path.partition(".")
    inner = getattr(record, name)
    if rest:
        return record._replace(**{name: damage_array(inner, rest, share, kind)})
    changed, k = inner.copy(), int(share * inner.size)
    changed.flat[k] = damage_number(changed.flat[k], kind)
    return record._replace(**{name: changed})


@experiment("extremes.nsf.damage", title="NSF: damaged fields, in memory and as files",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 280})
def damage(run):
    """Count harmless, noticed and silent damage in memory; a damaged file must be refused."""
    trials, sealed = [], []
    for name, tested in scenes(run):
        bench = FieldBench(name, tested)
        cases = [(path, kind) for path in SHOWN[run.profile] for kind in KINDS[run.profile]]
        for path, kind in run.progress(cases, f"{name}, damages"):
            fields = damage_array(tested.fields, path, run.rng.random(), kind)
            trials.append(bench.trial(f"{path}: {kind}", bench.drawn(bench.count), fields))
            sealed.append(sealed_trial(bench, trials[-1], fields))
        sealed.append(sealed_trial(bench, bench.trial("none", bench.drawn(bench.count))))
        if name == FILE_SCENE:
            record_files(run, name, refit(tested, Sizes(tested.fields.r, *SMALL), follows=True))
    record_ends(run, trials)
    record_silent(run, "extremes.nsf.damage", sealed, ERRORS)
    record_seal(run, trials, sealed)
    trial_table(run, trials)


def sealed_trial(bench, trial, fields=None):
    """Return the `ReducedTrial` of a run that compares its fields with the seal of the bench's."""
    names = damaged_arrays(bench.tested.fields if fields is None else fields, bench.monitor.seal)
    message = f"changed in memory: {', '.join(names)}" if names else trial.end.message
    return trial._replace(end=trial.end._replace(message=message))


def record_seal(run, trials, sealed):
    """Record the number of silent runs without the seal, and whether it lets sound fields pass."""
    run.record("extremes.nsf.damage.without_seal", sum(t.kind == SILENT for t in trials),
               unit="runs", comparator="info", scale=f"{len(trials)} runs, {ERRORS}",
               note="silent runs of the same damage, judged by the states of the run alone")
    sound = [t for t in sealed if t.what == "none"]
    run.record("extremes.nsf.damage.sound_refused", sum(t.kind != FINE for t in sound),
               unit="runs", paper=0, comparator="=", scale=f"{len(sound)} runs of sound fields",
               note="runs without damage that were stopped or flagged")


def record_ends(run, trials):
    """Record the share of runs flagged or stopped by the kind of damage, without the seal."""
    for kind in KINDS[run.profile]:
        runs = [t for t in trials if t.what.endswith(f": {kind}")]
        passed = [t for t in runs if t.kind in (FINE, SILENT)]
        worst = max(passed, key=lambda t: t.end.error / t.usual, default=None)
        largest = "none passed" if worst is None else (
            f"largest error of those that passed {worst.end.error:.3g} %, {worst.model}, "
            f"{worst.what}, usual {worst.usual:.3g} %")
        run.record(f"extremes.nsf.damage.{kind.replace(' ', '-')}", 1.0 - len(passed) / len(runs),
                   comparator="info", scale=f"{len(runs)} runs with one damaged number, {ERRORS}",
                   note=f"share flagged or stopped without the seal; {largest}")


def record_files(run, name, tested):
    """Record whether damaged and unfit files of a scene's fields are refused. These depend on the
    parameter, so that no array is empty.
    """
    count = run.choose(quick=1, standard=10)
    with tempfile.TemporaryDirectory() as folder:
        path, copy = Path(folder) / "fields.npz", Path(folder) / "copy.npz"
        model_file.save(path, Model(tested.fields, tested.xhat, tested.xhat[0, 0], {}))
        cases = {"damaged": damages(path, count, run.rng),
                 "unfit": invalid_contents(load_arrays(path))}
        for group, files in cases.items():
            rows = read_copies(files, copy, model_file.load)
            record_refusals(run, f"extremes.nsf.damage.files.{group}", rows,
                            f"{len(rows)} files of {name}'s fields", folder)
