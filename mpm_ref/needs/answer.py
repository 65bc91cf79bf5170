"""State what a scene requires: the table on the terminal, the JSON file, the lean scene."""

from dataclasses import asdict, dataclass
from math import isfinite

from .. import __version__
from ..scene import SceneError
from ..scene.quantity_records import quantity_of
from ..scene.toml import digest
from ..store.manifest import code
from ..sweep.observation import FINISHED
from ..sweep.scene_text import scene_text
from .code_parts import table_lines
from .removal import (
    COSTLY,
    IMPOSSIBLE,
    MOST_CPU,
    NOT_REQUIRED,
    REQUIRED,
    UNMEASURED,
    saving,
)


@dataclass(frozen=True)
class NeedsAnswer:
    """The result of a command with what it was asked."""

    name: str               # of the scene's file, without suffix
    command: str
    error: float
    result: object          # `NeedsResult`
    code: dict              # {"as given": `CodeParts`, "lean": `CodeParts`}

    @property
    def lines(self):
        """Return the answer as lines of text."""
        result = self.result
        return [*scene_lines(result), "",
                *(removal_line(run, self) for run in result.singles), "",
                *lean_lines(self), "", *table_lines(self.code)]

    @property
    def outputs(self):
        """Return the labels of the removals of output, which the lean scene keeps."""
        return [label for label, one in self.result.first.offers.items() if one.is_output]

    @property
    def facts(self):
        """Return all that was measured as plain values."""
        result = self.result
        return {
            "command": self.command,
            "title": result.first.scene.title,
            "scene_sha256": digest(result.first.scene),
            **code(),
            "error": self.error,
            "quantities": list(result.base.values),
            "warnings": list(result.base.warnings),
            "given": asdict(result.base.cost) | {"cpu": result.cpu, "noise": result.noise},
            "errors": asdict(result.errors),
            "removals": [run_facts(run, result) | {"text": removal_line(run, self),
                                                   "output": run.label in self.outputs}
                         for run in result.singles],
            "order": [run_facts(run, result) for run in result.order],
            "lean_removals": [removal.label for removal in result.lean.removals],
            "complete": result.complete,
            "missing_cpu": result.missing_cpu,
            "code": {name: parts.facts for name, parts in self.code.items()},
        }


def percent(share):
    """Return a share as a percentage with two digits."""
    text = f"{100.0 * share:.2g}"
    return f"{float(text):g} %" if 1e-4 < abs(100.0 * share) < 1e6 else f"{text} %"


def changed_text(changes):
    """Return the changes of quantities in words."""
    return ", ".join(f"{text} by {percent(change)}" for text, change in changes.items())


def scene_lines(result):
    """Return lines on the scene as given: its cost and its errors."""
    scene, cost, errors = result.first.scene, result.base.cost, result.errors
    lines = [f"warning: the scene as given: {text}" for text in result.base.warnings]
    lines += [f"{scene.title or 'scene'}: {cost.particles} particles, {cost.steps} steps, "
             f"{result.cpu:.3g} s of CPU time (equal runs differ by {percent(result.noise)})"]
    if errors.perturbation:
        lines.append(f"a perturbation by 1e-10 cells changes {changed_text(errors.perturbation)}")
    if errors.grid:
        note = f" ({errors.message})" if errors.message else ""
        lines.append(f"{grid_text(errors)} instead of dx changes {changed_text(errors.grid)}{note}")
    return lines


def removal_line(run, answer):
    """Return the sentence on one removal."""
    note = "; the lean scene keeps its frames" if run.label in answer.outputs else ""
    return f"{run.label}: {verdict_text(run, answer)}{note}"


def verdict_text(run, answer):
    """Return the verdict on a removal in words."""
    cpu, error = answer.result.cpu, percent(answer.error)
    if run.verdict == REQUIRED and run.outcome != FINISHED:
        return f"required (without it: {run.message})"
    if run.verdict == REQUIRED:
        return f"required (changes {changed_text(run.changes)}{grid_note(run, answer.result)})"
    if run.verdict == NOT_REQUIRED:
        return (f"not required at {error} ({changed_text(run.changes)}), "
                f"{saving_text(saving(run, cpu), answer.result.noise)}")
    if run.verdict == COSTLY and run.outcome == FINISHED:
        return (f"not required at {error} ({changed_text(run.changes)}), but without it a run "
                f"takes {percent(-saving(run, cpu))} more CPU time")
    if run.verdict == COSTLY:
        return f"costs more to leave out: a run takes over {MOST_CPU:g} times the CPU time"
    return {IMPOSSIBLE: f"cannot be removed ({run.message})",
            UNMEASURED: f"not measured ({run.message})"}[run.verdict]


def grid_note(run, result):
    """Return the remark that a change is less than that by another grid, or nothing."""
    errors = result.errors
    below = errors.grid and all(run.changes[text] < errors.grid[text] for text in run.changes)
    if not below:
        return ""
    return f"; {grid_text(errors)} instead of dx changes more"


def grid_text(errors):
    """Return the other grid spacing as text."""
    return "dx/2" if errors.grid_factor < 1.0 else "2 dx"


def saving_text(share, noise):
    """Return a saving of CPU time in words; one within the noise of times is none."""
    return f"saves {percent(share)} of CPU time" if share > noise else "saves no CPU time"


def lean_lines(answer):
    """Return lines on the lean scene and what led to it."""
    result = answer.result
    if not result.order:
        lines = ["lean scene: the scene as given, nothing "
                 + ("can be removed" if result.complete else "was removed within the budget")]
    else:
        last = result.order[-1]
        lines = [f"lean scene, {answer.name}.lean.toml: changes {changed_text(last.changes)}, "
                 f"{last.cpu:.3g} s of CPU time "
                 f"({saving_text(saving(last, result.cpu), result.noise)})"]
        lines += [f"  without {step}" for step in order_lines(result)]
    if not result.complete:
        lines.append(f"the budget ended first: about {result.missing_cpu:.3g} s of CPU time more "
                     "for the removals that were not measured")
    return lines


def order_lines(result):
    """Return a line for each step of the order: removals, change so far, CPU time."""
    return [f"{run.label} ({changed_text(run.changes)} so far, {run.cpu:.3g} s)"
            for run in result.order]


def run_facts(run, result):
    """Return a `RemovalRun` as plain values, with its saving."""
    share = saving(run, result.cpu)
    return asdict(run) | {"saving": share if isfinite(share) else None}


def lean_text(answer, folder, quantities=()):
    """Return the TOML text of the lean scene for a file in a folder, with comments.

    quantities: records of quantities of interest that the scene as given has.
    """
    result = answer.result
    head = [f"{result.first.scene.title or answer.name}, without what it does not require at "
            f"{percent(answer.error)}.", "", f"Written by mpm_ref {__version__}: {answer.command}",
            f"As given: {result.cpu:.3g} s of CPU time. Removed, one after the other:",
            *([f"  {line}" for line in order_lines(result)] or ["  nothing"])]
    gone = [removal for removal in result.lean.removals if removal.body or removal.half]
    head += [f"{removal.label}: positions are compared on the matter that is left."
             for removal in gone]
    if len(result.lean.axes) < result.first.scene.dim:
        factor = result.lean.length * 2 ** len(result.lean.halves)
        head.append(f"Energies, and impulses and forces of parts that no mirror plane leaves out, "
                    f"times {factor:g} m are those of the scene in 3D.")
    kept = []
    for one in quantities:
        try:
            kept.append(quantity_of(result.lean.quantity(one.text)))
        except SceneError as fault:
            head.append(f"No [[quantity]] {one.text}: {fault}")
    return scene_text(head, result.lean.scene, folder, kept)
