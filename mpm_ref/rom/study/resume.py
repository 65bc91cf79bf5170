"""Resuming a reduced run that was cut off, bit for bit, from its results file alone: a state is its
row of the group `reduced`, and the samples of earlier steps follow from the seed.
"""

from pathlib import Path
from typing import NamedTuple

from ...store.manifest import code, scene_hash
from ...store.results import Results
from ...store.running import INTERRUPTED, Refused
from ...store.text import counted
from ..latent import Latent
from ..step import StepReport
from .record import UNENDED, marked_problem

COMPUTE = ("numpy", "scipy", "numba", "llvmlite")       # libraries that shape the bits


class EarlierPart(NamedTuple):
    """The part of a run that a results file has."""

    states: tuple           # (`Latent`, `Report` or None) of its frames but the run's last
    same_code: bool         # all of it was made by this code


NOTHING = EarlierPart((), True)


def earlier_part(recording, out, overwrite):
    """Return the `EarlierPart` in the file `out`, NOTHING where the run starts anew. Raises
    `Refused` where a file exists that is neither to be continued nor replaced, and BadResults for
    one that is no results file.
    """
    if not Path(out).exists():
        return NOTHING
    with Results(out) as results:
        if overwrite:
            return NOTHING
        if not was_cut_off(results.manifest):
            raise Refused(f"{out} exists: add --overwrite to replace it, or name another file")
        if results.h5.attrs["scene_sha256"] != scene_hash(marked_problem(recording)):
            raise Refused(f"{out} holds another reduced run, cut off after "
                          f"{counted(len(results), 'frame')}: give its study, map and options to "
                          "go on with it, --overwrite to replace it, or name another file")
        states = stored_states(results)[:recording.problem.clock.steps]
        return EarlierPart(states, is_same_code(results.manifest))


def was_cut_off(facts):
    """Return whether a manifest is that of a reduced run that was interrupted or killed."""
    parts = facts.get("parts")
    return "reduced" in facts and (not parts or parts[-1]["why"] in (INTERRUPTED, UNENDED))


def is_same_code(facts):
    """Return whether all parts of the run of a manifest were made by this code with these
    libraries.
    """
    now = _code_of(code())
    return all(_code_of(entry) == now for entry in (facts, *facts["parts"]))


def _code_of(entry):
    """Return hash and versions, None where an entry has none."""
    versions = entry.get("versions", {})
    return entry.get("source_sha256"), *(versions.get(name) for name in COMPUTE)


def stored_states(results):
    """Return (`Latent`, `Report` or None) of each frame of a reduced run."""
    rows = {name: series[:len(results)] for name, series in results.h5["reduced"].items()}
    states, latent = [], None
    for k in range(len(results)):
        xhat, vhat = rows["xhat"][k], rows["vhat"][k] if "vhat" in rows else None
        latent = latent.advance(xhat, vhat) if k else Latent(xhat, vhat)
        states.append((latent, stored_report(rows, k) if k else None))
    return tuple(states)


def stored_report(rows, k):
    """Return the `Report` of step k, as far as it is stored."""
    quadrature = {"lost": int(rows["lost"][k])} if "lost" in rows else {}
    return StepReport(int(rows["samples"][k]), int(rows["points"][k]), int(rows["rank"][k]),
                  float(rows["residual"][k]), 0, True, quadrature)
