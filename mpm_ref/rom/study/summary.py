"""The summary of the reduced run in a results file."""

import numpy as np

from .monitor import stored_check


def summary(results):
    """Return what the manifest of `Results` says of a reduced run, with the number of its states
    that were out of bounds, and the means of samples and of integration points of a step; None of a
    full-order run.
    """
    facts = results.manifest.get("reduced")
    if facts is None or "reduced" not in results.h5:
        return None
    n = len(results)
    rows = {name: series[:n] for name, series in results.h5["reduced"].items()}
    out = sum(bool(stored_check(rows, k).out_of_bounds) for k in range(n))
    means = {f"mean_{name}": float(np.mean(rows[name][1:])) if n > 1 else None
             for name in ("samples", "points")}
    return facts | {"states": n, "out_of_bounds": out} | means


def summary_line(facts):
    """Return a `summary` in words."""
    name = facts.get("name", facts["study"][:12])
    parameters = ", ".join(f"{key} = {value:g}" for key, value in facts["parameters"].items())
    step = "" if facts["mean_points"] is None else (
        f"a step has {facts['mean_samples']:.4g} samples and {facts['mean_points']:.4g} "
        "integration points on average; ")
    return (f"reduced: {name}, {facts['map']['kind']} r = {facts['map']['r']}, {parameters}; "
            f"{step}{facts['out_of_bounds']} of {facts['states']} states out of bounds")
