"""Advice for a scene from the answer on a similar one, without a run.

What carries over is the number of cells over the largest body, and all other knobs. Whether the
error carries over is not known.
"""

import json
from math import isfinite
from pathlib import Path

from ..scene import SceneError
from ..sweep.setting import setting

TYPES = {"dx": float, "particles": float, "cfl": float, "eps": float,
         "degree": int}      # else texts


def read_answer(path):
    """Return the facts in a file SCENE.trade.json. Raises SceneError for another file."""
    try:
        facts = json.loads(Path(path).read_text(encoding="utf-8"))
        rows, cells = facts["rows"], float(facts["cells"])
        complete = isfinite(cells) and all({"setting", "error", "cpu", "outcome", "text"}
                                           <= row.keys() for row in rows)
    except OSError as fault:
        raise SceneError(f"{path}: {fault.strerror}; expected the answer that `mpm-ref trade` "
                         "writes for the similar scene") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        complete = False
    if not complete:
        raise SceneError(f"{path}: not an answer of `mpm-ref trade`; run it on the similar scene")
    return facts


def cheapest_row(facts, error):
    """Return the row of the cheapest setting of an answer that keeps an error, its reference's
    included, or None.
    """
    margin = max(facts["references"][text]["error"] or float("inf")
                 for text in facts["quantities"])
    good = [row for row in facts["rows"] if row["outcome"] == "finished"
            and row["error"] is not None and row["error"] + margin <= error]
    return min(good, key=lambda row: row["cpu"], default=None)


def carried_over(row, cells, own_cells):
    """Return the setting of a row for a scene with so many cells over its largest body, where the
    row's scene had `cells`. Raises ValueError for a knob that does not exist, or its value.
    """
    knobs = dict(row["setting"])
    for name, value in knobs.items():
        if not isinstance(value, TYPES.get(name, str)):
            raise ValueError(f"{name} = {value!r}: expected a value as `mpm-ref trade` writes it")
    return setting(**knobs | {"dx": knobs.get("dx", 1.0) * own_cells / cells})
