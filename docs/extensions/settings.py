"""Tables of the guide "Choose settings": the recorded settings that reach an error of 1 %."""

from collections import defaultdict
from math import inf, isfinite, sqrt

from .markdown import grid_table

LIMIT = 0.01            # error that counts as reached
TIE = 1.1               # times the least CPU time: as cheap
WORSE = 2.0             # times the error of the default that a change may have on other scenes
BOX = 1.0               # [m] side of the box in which NCLaw's bodies move
METHODS = ("hot", "hot-plus", "lbfgs-h", "pn-pcg-mf", "pn-mgpcg")
CHOICES = {"default": "base (cfl about 0.6)", "dx": "grid", "dt": "time step",
           "particles": "particles", "transfer": "transfer", "degree": "spline",
           "sampling": "sampling"}
PRINTED = 1e-7          # HOT's tolerance
KNOBS = "transfer", "flip", "degree", "cells", "per", "sampling", "cfl", "storage"
SCENES = {"mms": "manufactured solution", "cantilever": "cantilever"}
SAMPLES = {"random": "random", "cubature": "weighted",
           "cells": "weighted, in few cells"}


def pages(results):
    """Return {path: text} of the tables, from the `ProfileResults` of a profile."""
    tables = {"scenes": scenes, "explicit": explicit, "implicit": implicit,
              "implicit-runs": implicit_runs, "ldm": ldm, "nsf": nsf, "nclaw": nclaw}
    return {f"results/generated/settings-{name}.md": "\n".join(table(results)) + "\n"
            for name, table in tables.items()}


def records(results, experiment, name):
    """Return the rows of a recorded table as dictionaries."""
    columns = results.table(experiment, name)
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def percent(error):
    """Return an error as text in per cent, bold where it is at most LIMIT."""
    if not isfinite(error):
        return "unstable"
    text = f"{number(100.0 * error)} %"
    return f"**{text}**" if error <= LIMIT else text


def number(x):
    """Return two digits of a number, or all before the point."""
    return f"{x:.0f}" if abs(x) >= 100.0 else f"{x:.2g}"


def scenes(results):
    """Yield what `mpm-ref trade` recommends on shipped scenes."""
    header = ["scene", "error asked", "holds until", "recommended setting", "error", "CPU s",
              "error of the scene's own", "its CPU s"]
    yield from grid_table(header, (
        [f"`{row['scene']}`", f"{100.0 * row['asked']:g} %",
         f"{row['until']:.2g} of {row['end']:.2g} s", row["setting"] or "none",
         *(measured(row) if row["setting"] else ("", "", "", f"{row['own_cpu']:.2g}"))]
        for row in records(results, "trade.scenes", "advice")))


def measured(row):
    """Return the errors and costs of an advice as cells."""
    return (f"{number(100.0 * row['error'])} %", f"{row['cpu']:.2g}",
            f"{number(100.0 * row['own_error'])} %", f"{row['own_cpu']:.2g}")


def explicit(results):
    """Yield the cheapest setting and all settings of the two explicit scenes."""
    points = {scene: records(results, f"trade.explicit.{scene}", "points") for scene in SCENES}
    for scene, title in SCENES.items():
        floor = reference_error(results, scene)
        best = advised(points, scene, floor)
        yield f"- {advice_text(title, best, floor)}"
    yield ""
    header = ["changed", "setting"]
    for title in SCENES.values():
        header += [f"error, {title}", "CPU s"]
    pairs = [pair for pair in zip(*points.values(), strict=True) if pair[0]["knob"] in CHOICES]
    pairs.sort(key=lambda pair: [*CHOICES].index(pair[0]["knob"]))
    yield from grid_table(header, (
        [CHOICES[pair[0]["knob"]], explicit_setting(pair[0]) + stability(pair),
         *(text for p in pair for text in (percent(p["error"]), f"{p['cpu']:.2g}"))]
        for pair in pairs))


def reference_error(results, scene):
    """Return the error of the reference of an explicit scene, relative."""
    name = f"trade.explicit.{scene}"
    return results.value(name, f"{name}.reference_error")


def advised(points, scene, floor):
    """Return the cheapest row of a scene that keeps LIMIT for certain, or None; of those as cheap
    that with the least error.

    points: rows {scene: [..]}; floor: error of the scene's reference, which is added. The step is
    stable, and on no other scene does the same change have more than WORSE times the error of the
    default there: what helps by chance on one scene is no advice.
    """
    fit = [p for p in points[scene] if p["knob"] in CHOICES and p["of_bound"] <= 1.0
           and p["error"] + floor <= LIMIT
           and all(holds(p, others) for name, others in points.items() if name != scene)]
    least = min((p["cpu"] for p in fit), default=0.0)
    return min((p for p in fit if p["cpu"] <= TIE * least), key=lambda p: p["error"], default=None)


def holds(change, others):
    """Return whether a change keeps the error on another scene, by that scene's rows."""
    error = {tuple(p[key] for key in KNOBS): p["error"] for p in others}
    default = next(p["error"] for p in others if p["knob"] == "default")
    return error.get(tuple(change[key] for key in KNOBS), inf) <= WORSE * default


def advice_text(title, best, floor):
    """Return the advice for a scene as a sentence."""
    lead = f"Cheapest stable setting with at most 1 % on the {title}"
    added = f"; the reference's own error of {100.0 * floor:.2g} % is added" if floor else ""
    if best is None:
        return f"{lead}: none that was tried{added}."
    return (f"{lead}: {explicit_setting(best)} (error {100.0 * best['error']:.2g} %, "
            f"{best['cpu']:.2g} CPU s{added}).")


def stability(pair):
    """Return a remark on a setting whose time step exceeds the stable one in a scene."""
    return "; above the stable step" if max(p["of_bound"] for p in pair) > 1.0 else ""


def explicit_setting(point):
    """Return the changed choice of a setting in words."""
    per = int(point["per"])
    return {
        "default": f"{point['cells']:g} cells, {per} x {per} particles per cell, MLS-MPM, "
                   "quadratic splines, c dt/dx = 0.5",
        "dx": f"{point['cells']:g} cells",
        "dt": f"c dt/dx = {point['cfl']:g}",
        "particles": f"{per} x {per} per cell",
        "transfer": point["transfer"] + (f", flip = {point['flip']:g}"
                                         if point["transfer"] == "flip" else ""),
        "degree": f"degree {point['degree']:g}, {point['transfer']}, {per} x {per} per cell",
        "sampling": point["sampling"],
    }.get(point["knob"], point["knob"])


def implicit(results):
    """Yield, for each step, the loosest tolerance and the time with which methods reach 1 %."""
    ladders = defaultdict(list)
    for p in records(results, "trade.hot.bar", "points"):
        ladders[f"bar, middle of {p['E']:.0e} Pa".replace("e+0", "e")].append(p)
    for p in records(results, "trade.hot.scenes", "points"):
        if p["size"] == "quick":
            ladders[p["scene"].replace("_", ", ").replace("armacat", "ArmaCat")].append(p)
    yield from grid_table(["step", *METHODS], (
        [name, *(tolerance(ladder, method) for method in METHODS)]
        for name, ladder in ladders.items()))


def tolerance(ladder, method):
    """Return the cheapest tolerance of a method with an error of at most LIMIT, and its time."""
    tried = [p for p in ladder if p["method"] == method]
    good = [p for p in tried if p["error"] <= LIMIT and p["converged"] == "True"]
    if not good:
        return "none" if tried else "not run"
    best = min(good, key=lambda p: p["cpu"])
    return f"{best['eps']:.0e}, {best['cpu']:.2g} s".replace("e-0", "e-")


RUN_SPREAD = "trade.hot.energy.spread.eps1e-11"     # between methods: the reference's own error


def implicit_runs(results):
    """Yield the rules with which whole implicit runs keep LIMIT, by method."""
    *rows, answer = records(results, "trade.hot.energy", "ends")
    floor = results.value("trade.hot.energy", RUN_SPREAD)
    header = ["method", "stop", "kinetic energy off by", "particles off by (rms)", "CPU s"]
    tables = []
    for method in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == method]
        best = advised_run(mine, answer, floor)
        printed = next((row for row in mine if row["eps"] == PRINTED and not row["cells"]), None)
        tables += [row for row in (printed, best) if row is not None]
    yield from grid_table(header, (run_row(row, answer) for row in tables))


def advised_run(rows, answer, floor):
    """Return the cheapest run whose kinetic energy keeps LIMIT for certain, and whose particles
    are within LIMIT cells on average; or None.
    """
    fit = [row for row in rows if row["converged"] == "True" and row["rms"] <= LIMIT
           and abs(row["kinetic"] / answer["kinetic"] - 1.0) + floor <= LIMIT]
    return min(fit, key=lambda row: row["cpu"], default=None)


def run_row(row, answer):
    """Return the cells of a whole run."""
    stop = (f"`displacement_tolerance = {row['cells']:g}`" if row["cells"] else
            f"`eps = {row['eps']:.0e}`".replace("e-0", "e-"))
    return [row["method"], stop, percent(abs(row["kinetic"] / answer["kinetic"] - 1.0)),
            f"{row['rms']:.2g} cells", f"{row['cpu']:.2g}"]


def ldm(results):
    """Yield, for networks and modes, the cheapest setting for each meaning of 1 %."""
    rows = records(results, "trade.ldm.gravity", "settings")
    yield from grid_table(
        ["error of 1 % relative to", "map", "latent coordinates", "samples", "step", "error",
         "CPU s", "full run, CPU s"],
        (ldm_row(measure, kind, [r for r in rows if r["map"] == kind])
         for measure in ("displacement", "origin") for kind in ("pod", "network")))


MEASURES = {"displacement": "the displacement", "origin": "the distance from the origin"}


def ldm_row(measure, kind, rows):
    """Return the cells of the cheapest setting of one map."""
    good = [row for row in rows if row[measure] <= LIMIT]
    name = {"pod": "modes", "network": "network"}[kind]
    if not good:
        return [MEASURES[measure], name, *"—" * 6]
    best = min(good, key=lambda row: row["cpu_run"])
    return [MEASURES[measure], name, f"{best['r']:g}", str(best["points"]),
            f"{best['longer']:g} dt", percent(best[measure]), f"{best['cpu_run']:.2g}",
            f"{best['cpu_full']:.2g}"]


def nsf(results):
    """Yield, for each scene, from how many samples on all runs keep 1 %."""
    worst = defaultdict(lambda: {"origin": 0.0, "displacement": 0.0, "stress": 0.0})
    times = {}
    for row in records(results, "trade.nsf.samples", "samples"):
        key = row["scene"], row["fields"], int(row["samples"])
        times[key] = row["cpu"], row["cpu_full"]
        for measure, value in worst[key].items():
            worst[key][measure] = max(value, row[measure] if isfinite(row[measure]) else 1e9)
    yield from grid_table(
        ["scene", "samples", "needed", "error relative to the distance from the origin",
         "relative to the displacement", "of the stress", "CPU s", "full run, CPU s"],
        (nsf_row(scene, kind, worst, times)
         for scene in dict.fromkeys(key[0] for key in worst) for kind in SAMPLES))


def nsf_row(scene, kind, worst, times):
    """Return the cells of the fewest samples from which on no run exceeds LIMIT."""
    counts = sorted(key[2] for key in worst if key[:2] == (scene, kind))
    bad = [count for count in counts if worst[scene, kind, count]["origin"] > LIMIT]
    enough = next((count for count in counts if not bad or count > bad[-1]), None)
    if enough is None:
        return [scene, SAMPLES[kind], *"—" * 6]
    key = scene, kind, enough
    errors = [f"{number(100.0 * worst[key][m])} %" for m in ("origin", "displacement", "stress")]
    unit = " cells" if kind == "cells" else ""
    return [scene, SAMPLES[kind], f"{enough}{unit}", *errors, *(f"{t:.2g}" for t in times[key])]


def nclaw(results):
    """Yield the trainings of jelly's laws, by the root mean square error on two runs."""
    rows = [r for r in records(results, "trade.nclaw.training", "trainings")
            if r["environment"] == "jelly" and r["epoch"] == r["epochs"]]
    yield from grid_table(
        ["particles", "cells per axis", "epochs", "steps at the horizon's end", "seed",
         "training, CPU s", "error on its own run", "error in the paper's body"],
        ([f"{r['edge']:g}^3", f"{r['cells']:g}", f"{r['epochs']:g}", f"{r['last']:g}",
          f"{r['seed']:g}", f"{r['cpu']:.3g}", share(r["own"]), share(r["full"])]
         for r in sorted(rows, key=lambda r: r["cpu"])))


def share(mean_square):
    """Return a mean square error [m^2] as its root over the box, or why there is none."""
    return percent(sqrt(mean_square) / BOX) if isfinite(mean_square) else "—"
