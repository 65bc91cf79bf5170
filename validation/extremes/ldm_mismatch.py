"""Maps run on a body or under a load that they were not trained with, where no file name, study or
checksum stands in the way.
"""

from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions

from ..common.registry import experiment
from ..common.scenes import with_
from ..ldm.studies import GRAVITY, POKES, TORSION
from .ldm_runs import FLAGGED, STOPPED, Trial, ended, full, learned, record_silent, table_of

OF = {"gravity-r4": "gravity", "gravity-r7": "gravity", "torsion-0": "torsion", "poke": "poke"}
QUICK = ("gravity-r4", "poke")
STEPS, SAMPLES = 30, 50


@experiment("extremes.ldm.mismatch", title="LDM: maps of another body or load",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 15})
def mismatch(run):
    """The watch must notice each; a map on its own body is the usual."""
    runs, found = {}, []
    for study, k in ((GRAVITY, 21), (TORSION, 20), (POKES, 1)):
        one = ldm_full_model(with_(study.scene(*study.mu[k]), steps=STEPS))
        runs[study.name] = one, full(one.problem)[0]
    for name in run.progress(run.choose(quick=QUICK, standard=tuple(OF)), "maps"):
        own = OF[name]
        ends = {study: ended(*both, learned(name), RunOptions(points=SAMPLES))
                for study, both in runs.items()}
        found += [Trial(name, f"on {study}", RunOptions().name, SAMPLES, ends[own].error, end)
                  for study, end in ends.items() if study != own]
    missed = [f"{t.map} {t.what}: {t.end.error:.3g} %" for t in found
              if t.kind not in (FLAGGED, STOPPED)]
    scale = f"first {STEPS} steps, {SAMPLES} samples"
    run.record("extremes.ldm.mismatch.noticed", 1.0 - len(missed) / len(found), paper=1.0,
               comparator="=", scale=f"{scale}, {len(found)} runs",
               note="; ".join(("share flagged or stopped", *missed)))
    record_silent(run, "extremes.ldm.mismatch", found, scale)
    table_of(run, found)
