"""The atlas of extremes: a table of kinds of extremes and methods, coloured by verdicts.

The verdicts are those of the records in results/standard; an entry leads to the numbers of its
experiment.
"""

from collections import Counter

from validation.common.judge import VERDICTS

from .markdown import cell, grid_table

PAGE = "results/generated/atlas.md"
GROUP = "extremes"
METHODS = {"explicit": "explicit MPM", "hot": "HOT", "ldm": "LDM", "nsf": "NSF", "nclaw": "NCLaw"}
KINDS = {       # of extremes: ids of experiments without "extremes."
    "time step": ("explicit.cfl_ladder", "explicit.single_particle", "hot.time_step", "ldm.dt",
                  "nclaw.dt"),
    "stiffness, and its contrasts": ("explicit.map", "explicit.contact", "hot.stiffness",
                                     "hot.fall"),
    "incompressibility": ("explicit.locking", "hot.poisson"),
    "distance from the origin, units": ("explicit.far_from_origin", "hot.units"),
    "long runs": ("explicit.long_run", "ldm.long", "nsf.long", "nclaw.long"),
    "nothing happens": ("explicit.free_flight", "hot.nothing"),
    "large strain, fracture": ("explicit.fracture", "hot.stretched", "nclaw.strain"),
    "degenerate deformation": ("explicit.degenerate", "explicit.return_maps", "hot.broken",
                               "hot.hopeless", "ldm.singular", "nclaw.singular"),
    "few particles, light nodes, loose pieces": ("explicit.tiny_node", "explicit.null_mode",
                                                 "hot.sparse", "hot.pieces"),
    "few samples": ("ldm.points", "nsf.samples", "nsf.unseen"),
    "outside of training": ("ldm.range", "ldm.mismatch", "nsf.beyond", "nclaw.density"),
    "poor training": ("nclaw.epochs", "nclaw.observed"),
    "damaged files and memory": ("ldm.files", "nsf.damage"),
    "each property of a scene over decades": ("explicit.scenes", "hot.scenes", "nclaw.scenes"),
    "bounds and guards": ("ldm.bound", "nsf.bound", "nclaw.bound", "nclaw.guard",
                          "nclaw.guarded_body"),
    "every method on the hardest states": ("hot.every_method",),
    "covered by the tests": ("explicit.elsewhere",),
}


def pages(shown):
    """Return {path: text} of the table, from `results.Shown` of all experiments."""
    entries = {one.section.id.removeprefix(f"{GROUP}."): one for one in shown
               if one.section.id.startswith(f"{GROUP}.") and one.profile == "standard"}
    rows = [[kind, *(entry_cell(ids, method, entries) for method in METHODS)]
            for kind, ids in KINDS.items()]
    return {PAGE: "\n".join(grid_table(("extreme", *METHODS.values()), rows))}


def entry_cell(ids, method, entries):
    """Return the cell of a method: the experiments of a kind of extreme, one below the other."""
    return " ".join(badge(name, entries[name]) for name in ids
                       if name.startswith(f"{method}.") and name in entries)


def badge(name, one):
    """Return an experiment as a coloured link with the counts of its verdicts."""
    counts = Counter(row.verdict for row in one.rows)
    text = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
    title = one.title.removeprefix(f"{METHODS[name.partition('.')[0]]}: ")
    link = f"[{cell(title[0].upper() + title[1:])}](#numbers.{GROUP}.{name})"
    return f'<span class="atlas-{colour(counts)}">{link}: {text}</span>'


def colour(counts):
    """Return the verdict that colours an entry: a miss if there is one, else a pass, else info."""
    if counts["miss"]:
        return "miss"
    return "pass" if counts["pass"] or counts["better"] else "info"
