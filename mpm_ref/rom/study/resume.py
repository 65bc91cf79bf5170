"""A reduced run that was cut off, to go on bit for bit: its file has all that is needed. A state is
its row of the group `reduced`, and the samples of steps before follow from the seed.
"""

from pathlib import Path
from typing import NamedTuple

from ...store.manifest import code, scene_hash
from ...store.results import Results
from ...store.running import INTERRUPTED, Refused
from ...store.words import counted
from ..latent import start_state
from ..step import Report
from .nsf_record import states as positions
from .record import UNENDED, marked
from .tables import NSF

COMPUTE = ("numpy", "scipy", "numba", "llvmlite")       # libraries that shape the bits


class Begun(NamedTuple):
    """What a file has of a run."""

    known: tuple            # (`Latent`, `Report` or None) of its frames but the run's last; of
                            # NSF's model without rates
    same_code: bool         # whether all of it was made by this code


NOTHING = Begun((), True)


def begun(recording, out, overwrite):
    """`Begun` of the file `out`, NOTHING where the run begins anew. Raises `Refused` where a file
    stands that is neither to be continued nor replaced, and BadResults for one that is no results
    file.
    """
    if not Path(out).exists():
        return NOTHING
    with Results(out) as results:
        if overwrite:
            return NOTHING
        if not cut_off(results.manifest):
            raise Refused(f"{out} exists: add --overwrite to replace it, or name another file")
        if results.h5.attrs["scene_sha256"] != scene_hash(marked(recording)):
            raise Refused(f"{out} holds another reduced run, cut off after "
                          f"{counted(len(results), 'frame')}: give its study, map and options to "
                          "go on with it, --overwrite to replace it, or name another file")
        read = positions if recording.facts.get("model") == NSF else states
        known = read(results)[:recording.problem.clock.steps]
        return Begun(known, same_code(results.manifest))


def cut_off(facts):
    """Whether a manifest is that of a reduced run that was interrupted or killed."""
    parts = facts.get("parts")
    return "reduced" in facts and (not parts or parts[-1]["why"] in (INTERRUPTED, UNENDED))


def same_code(facts):
    """Whether the run of a manifest was begun, and all its parts were made, by this code with
    these libraries.
    """
    now = _made_by(code())
    return all(_made_by(entry) == now for entry in (facts, *facts["parts"]))


def _made_by(entry):
    """Hash and versions, None where an entry of older code does not say."""
    versions = entry.get("versions", {})
    return entry.get("source_sha256"), *(versions.get(name) for name in COMPUTE)


def states(results):
    """(`Latent`, `Report` or None) of each frame of a reduced run."""
    if not len(results):
        return ()
    rows = {name: series[:len(results)] for name, series in results.h5["reduced"].items()}
    latent = start_state(rows["xhat"][0])
    found = [(latent, None)]
    for k in range(1, len(results)):
        latent = latent.advance(rows["xhat"][k], rows["vhat"][k])
        found.append((latent, report_of(rows, k)))
    return tuple(found)


def report_of(rows, k):
    """`Report` of step k, as far as it is stored."""
    return Report(int(rows["samples"][k]), int(rows["points"][k]), int(rows["rank"][k]),
                  float(rows["residual"][k]), 0, True, {"lost": int(rows["lost"][k])})
