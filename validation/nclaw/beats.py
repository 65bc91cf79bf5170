"""Learned laws beside the simplest rivals: points that stay, points that fly, and "sys-id", the
classical law with parameters from the same motion.
"""

import numpy as np

from .errors import OURS, grouped, scale
from .rivals import RIVALS

LEARNED = (OURS, "labeled", "neural")
IDENTIFIED = "sys-id"


def record_beats(run, table, rows):
    """Record the error of each learned law over that of each rival, of `ErrorRow`s, by environment
    and task: below 1 the law is nearer. "sys-id", which knows the form of the true law, is no rival
    that a learned law can beat, and not judged.
    """
    for (name, task), group in grouped(rows).items():
        mean = {method: float(np.mean([row.error for row in group if row.method == method]))
                for method in dict.fromkeys(row.method for row in group)}
        for method in (one for one in LEARNED if one in mean):
            for rival in (one for one in (IDENTIFIED, *RIVALS) if one in mean):
                rule = ({"comparator": "info"} if rival == IDENTIFIED
                        else {"comparator": "<=", "bound": 1.0})
                run.record(f"{table}.beats.{rival}.{method}.{name}.{task}",
                           mean[method] / mean[rival], unit="1", **rule,
                           scale=scale(run, name, task),
                           note=f"mean squared distance over that of {rival}")
