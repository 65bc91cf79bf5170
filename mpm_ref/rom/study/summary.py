"""What a results file tells of the reduced run in it."""

import numpy as np

from . import nsf_watch as nsf
from .tables import NSF
from .watch import Sight


def told(results):
    """What is known of the reduced run of `Results`, with the number of its states that were out
    of bounds, and the means of samples and of integration points of a step; None of a full-order
    run.
    """
    facts = results.manifest.get("reduced")
    if facts is None or "reduced" not in results.h5:
        return None
    n = len(results)
    rows = {name: series[:n] for name, series in results.h5["reduced"].items()}
    look = nsf.sight if facts.get("model") == NSF else sight
    out = sum(bool(look(rows, k).why) for k in range(n))
    means = {f"mean_{name}": float(np.mean(rows[name][1:])) if n > 1 else None
             for name in ("samples", "points")}
    return facts | {"states": n, "out_of_bounds": out} | means


def sight(rows, k):
    """`Sight` of frame k, as far as it is stored; at the start nothing was sampled."""
    points, lost = int(rows["points"][k]), int(rows["lost"][k])
    blind = rows["xhat"].shape[1] - int(rows["rank"][k]) if k else 0
    inverted = rows["inverted"][k] if "inverted" in rows else 0.0    # not of files of older code
    return Sight(*(float(rows[name][k]) for name in ("beyond", "off", "seen")), blind,
                 lost / max(points + lost, 1), 1.0, float(inverted), 0.0)


def line(found):
    """The same in words."""
    name = found.get("name", found["study"][:12])
    parameters = ", ".join(f"{key} = {value:g}" for key, value in found["parameters"].items())
    step = "" if found["mean_points"] is None else (
        f"a step has {found['mean_samples']:.4g} samples and {found['mean_points']:.4g} "
        "integration points on average; ")
    return (f"reduced: {name}, {found['map']['kind']} r = {found['map']['r']}, {parameters}; "
            f"{step}{found['out_of_bounds']} of {found['states']} states out of bounds")
