"""The ids of NCLaw's printed errors, which belong to the paper's methods, runs and bodies.

Others have a word behind them (`verdicts.VARIANTS`). The printed splines and stretches are those of
the authors' release with its faults: the repaired ones are other methods.
"""

from .stand_in_bodies import has_mesh
from .tasks import TOYS

PRINTED = {"jelly": "jello", "sand": "sand", "plasticine": "plasticine", "water": "water"}
RELEASED = "-released"
METHODS = {         # of ours -> (the printed method, word behind the id)
    "ours": ("ours", ""), "ours-init": ("ours-init", ""), "labeled": ("labeled", ""),
    "sys-id": ("sys-id", ""), "gnn": ("gnn", "narrow"), "admissible": ("ours", "admissible"),
    "spline": ("spline", "repaired"), "neural": ("neural", "repaired"),
    f"spline{RELEASED}": ("spline", ""), f"neural{RELEASED}": ("neural", ""),
}


def error_id(table, method, name, task, variants=()):
    """Return the id of the error of a method in an environment; of one without a printed number, an
    id of our own.
    """
    printed, word = METHODS.get(method, (method, ""))
    id = f"{table}.{printed}.{PRINTED[name]}"
    return extended(id if task == "reconstruction" else f"{id}.{task}", (word, *variants))


def overall_id(table, method, what, variants=()):
    """Return the id of the mean or the deviation of a method's errors over all environments."""
    printed, word = METHODS.get(method, (method, ""))
    return extended(f"{table}.{printed}.overall_{what}", (word, *variants))


def extended(target, variants):
    """Return the id of a target with words of `verdicts.VARIANTS` behind it, but for empty ones."""
    return ".".join((target, *filter(None, variants)))


def run_variants(quick, name, task):
    """Return the words of runs that are not the paper's: cut short, or of another body."""
    other_body = task == "geometry" and not has_mesh(TOYS[name].name)
    return ("stand-in",) * other_body + ("partial",) * quick


def is_printed(method):
    """Return whether a method's errors stand beside printed ones."""
    return method in METHODS
