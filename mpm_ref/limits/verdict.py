"""Judge cells: right, wrong, or with the outcome of a run that did not finish.

A cell that finished is compared with its own physical problem on other grids. Its time step and its
particles follow the grid. The difference of two runs is the largest root mean square one of a
quantity, or with "@end" the last one, relative to its largest change during the reference run.

* The tolerance of a quantity is the error asked, or twice the difference of the scene as given from
  itself at dx/2, whichever is larger: nobody expects of a changed scene what the scene as given
  does not have.
* A cell is right if it differs from itself at 2 dx by at most the tolerance, which costs least.
  Otherwise itself at dx/2 decides; so it does of the farthest cell of each direction that is right,
  since two coarse grids may agree by chance.
* Cells that change numerical axes alone are compared with the scene as given at dx/2, which is one
  run for all of them; of shifted scenes the changes since the start are compared.
* A wrong cell has the name of its limit (see `cause`), for which its run at 2 dx is compared with
  that at dx/2 as well, and the warnings of its run.
* Where the only wrong quantity nearly vanishes, beside its change in the scene as given, that is
  the limit of the cell. A quantity that is zero throughout the reference is compared with its
  change in the scene as given.
* A cell in which a change of the speed carries two colliders into each other is refused without a
  run.
* A cell that changes the physical problem and has no contact that the scene as given has is another
  scene, whether it is right or wrong: its contact is lost.
* A cell whose run, or the one at dx/2 that decides, tears an elastic body (`indicators`) is torn,
  whatever it differs by, unless the scene as given tears one too.
* A cell is not checked where its run at dx/2 does not finish.
* A run is too long if it takes more than `MOST_LONGER` times the CPU time of the scene as given, on
  the grid of that run. Runs that the budget ended have no verdict.
"""

from dataclasses import dataclass, field, replace
from math import isfinite

import numpy as np

from ..sweep.difference import largest_change, relative_difference
from ..sweep.observation import CRASHED, REFUSED, STOPPED, TORN, UNSTABLE
from ..sweep.quantity import OutputQuantity
from ..sweep.runs import RunRequest
from .axes import AXIS, MOST_LONGER
from .cause import VANISHING, limit_of, vanishes
from .cell import COARSE, FINE, CellScenes, cell_text, physical

RIGHT, WRONG, UNCHECKED, LOST = "right", "wrong", "not checked", "contact lost"
OUTCOMES = (RIGHT, WRONG, UNCHECKED, LOST, TORN, UNSTABLE, REFUSED, STOPPED, CRASHED)
SLACK = 2.0             # times the scene's own difference from its refinement
LEAST_CPU = 2.0         # [s] that any run may take
BUDGET = 0.9            # of the CPU time allowed, below which a stopped run was stopped early
AT_FINE, AT_COARSE, AS_GIVEN = "itself at dx/2", "itself at 2 dx", "the scene as given at dx/2"


@dataclass(frozen=True)
class CellVerdict:
    """The verdict on a cell; errors and tolerances are relative, that of the worst quantity."""

    outcome: str                # of OUTCOMES
    message: str = ""           # of the run that did not finish
    error: float = np.nan       # difference from the reference, relative to its change
    tolerance: float = np.nan
    quantity: str = ""
    reference: str = ""         # in words
    cpu: float = np.nan         # [s] of the cell's run
    steps: int = 0
    until: float = 0.0          # [s] that it reached
    warnings: tuple = ()        # of the cell's run
    limit: str = ""             # of a wrong cell, of `cause.LIMITS`
    coarse_error: float = np.nan        # of the run at 2 dx of a wrong cell, as `error`
    indicators: dict = field(default_factory=dict)      # {name: worst value} of the cell's run
    share: float = np.nan       # of the reference's change in that of the scene as given
    alone: str = ""             # the axis that alone refuses a cell of two axes, which was not run

    @property
    def is_right(self):
        """Return whether the cell finished and agrees with its reference."""
        return self.outcome == RIGHT


class NoReference(Exception):
    """The scene as given has no reference: the message says why, and what it would take.

    outcome: that of its run.
    """

    def __init__(self, message, outcome):
        self.outcome = outcome
        super().__init__(message)


class CellJudge:
    """Runs cells and their references, each once, and judges them."""

    def __init__(self, scene, runs, probes, quantities, error):
        """Prepare to judge the cells of a scene whose end is a time.

        runs: `sweep.runs.SceneRuns`; probes: those of the scene as given; quantities: texts of
        those of the runs that are judged; error: relative.
        """
        self.scenes = CellScenes(scene, probes)
        self.runs, self.quantities, self.error = runs, quantities, error
        self.verdicts, self.base = {}, {}       # {cell: CellVerdict}, {dx: RunObservation}
        self.tolerance = {}                     # {quantity: relative}
        self.coarse = {}                        # {cell: CellVerdict beside itself at 2 dx}
        self.cpu = 0.0                          # [s] of all runs, references included

    def start(self):
        """Run the scene as given and its companions. Raises NoReference where one fails."""
        labels = {1.0: "as given", FINE: "as given, dx/2"}
        self.base |= self._observe({dx: ((), dx, np.inf, text) for dx, text in labels.items()})
        for dx in (1.0, FINE):
            run = self.base[dx]
            if not run.finished:
                price = self._price(dx) * (run.outcome == STOPPED)
                raise NoReference(f"{labels[dx]}: {run.outcome}: {run.message}{price}",
                                  run.outcome)
        differences = self._differences(self.base[1.0], self.base[FINE], False)
        unknown = [text for text, difference in differences.items() if not isfinite(difference)]
        if unknown:
            raise NoReference(f"{unknown[0]} is not a number at some time of the scene as given, "
                              "so that nothing can be compared with it; ask for another quantity",
                              REFUSED)
        self.tolerance = {text: max(self.error, SLACK * difference)
                          for text, difference in differences.items()}
        self.verdicts[()] = self._compared(self.base[1.0], self.base[FINE], (), AT_FINE)

    def _price(self, dx):
        """Return what the run would take, as far as the others say."""
        cpu, d = self.base[1.0].cost.cpu, self.scenes.tables()["dim"]
        if dx == 1.0 or not cpu > 0.0:
            return "; give a larger --budget"
        return (f"; it may take {cpu * 2.0 ** (d + 1):.0f} s of CPU time (the scene as given took "
                f"{cpu:.3g} s), and all limits about 100 times that: give a larger --budget")

    def judge(self, cells, by_fine_grids=False):
        """Return {cell: `CellVerdict`, or None where the budget ended first}.

        by_fine_grids: whether agreement with the coarse grid does not suffice.
        """
        new = [cell for cell in dict.fromkeys(cells)
               if self.needs_verdict(cell, by_fine_grids)]
        for cell in filter(self.scenes.refusal, new):
            self._note(cell, CellVerdict(REFUSED, self.scenes.refusal(cell)))
        new = [cell for cell in new if not self.scenes.refusal(cell)]
        runs = self._observe({cell: (cell, 1.0, self._most(1.0), cell_text(cell))
                              for cell in new})
        finished = [cell for cell in new if runs[cell].finished]
        for cell in new:
            if not runs[cell].finished:
                self._note(cell, self._unfinished(runs[cell], self._most(1.0)))
        stages = [self._by_tears, self._by_contacts, self._by_the_scene, self._by_coarse_grids,
                  self._by_fine_grids]
        if by_fine_grids:
            stages.remove(self._by_coarse_grids)
        for stage in stages:
            for cell, verdict in stage({c: runs[c] for c in finished}).items():
                self._note(cell, verdict)
                finished.remove(cell)
        return {cell: None if self.needs_verdict(cell, by_fine_grids) else self.verdicts[cell]
                for cell in cells}

    def refused_alone(self, cell):
        """Return the verdict on a cell of two axes that one of them alone refuses by the same
        message before any run, else None.
        """
        message = self.scenes.refusal(cell)
        axes = [one[0] for one in cell if message and message == self.scenes.refusal((one,))]
        return CellVerdict(REFUSED, message, alone=axes[0]) if axes and len(cell) > 1 else None

    def needs_verdict(self, cell, by_fine_grids):
        """Return whether a cell has no verdict yet, or one by a coarse grid where a fine one is
        asked for.
        """
        verdict = self.verdicts.get(cell)
        return verdict is None or (by_fine_grids and verdict.reference == AT_COARSE)

    def _note(self, cell, verdict):
        if verdict is not None:
            self.verdicts[cell] = verdict

    # what the verdicts rest on; each returns those that it can give

    def _by_tears(self, runs):
        """Return the verdicts on cells whose runs tear a body."""
        return {cell: torn_verdict(run, run.tear) for cell, run in runs.items() if self._tears(run)}

    def _tears(self, run):
        """Return whether a run tears a body, and those of the scene as given do not."""
        return bool(run.tear) and not any(one.tear for one in self.base.values())

    def _by_contacts(self, runs):
        """Return the verdicts on cells with a physical change that lost a contact of the scene as
        given.
        """
        verdicts = {}
        for cell, run in runs.items():
            lost = [text for text in self.base[1.0].contacts if text not in run.contacts]
            if lost and physical(cell):
                verdicts[cell] = CellVerdict(
                    LOST, f"no contact of {lost[0]}, which the scene as given has",
                    cpu=run.cost.cpu, steps=run.cost.steps, until=run.until,
                    warnings=run.warnings)
        return verdicts

    def _by_the_scene(self, runs):
        """Compare cells of numerical axes alone with the scene as given at dx/2."""
        return {cell: self._compared(run, self.base[FINE], cell, AS_GIVEN)
                for cell, run in runs.items() if not physical(cell)}

    def _by_coarse_grids(self, runs):
        """Compare cells of physical axes alone with themselves at 2 dx; those that agree are
        right.
        """
        runs = {cell: run for cell, run in runs.items() if physical(cell) == cell}
        coarse = self._companions(runs, COARSE)
        verdicts = {cell: self._compared(run, coarse[cell], cell, AT_COARSE)
                    for cell, run in runs.items() if not self._tears(coarse[cell])}
        self.coarse |= verdicts
        return {cell: verdict for cell, verdict in verdicts.items() if verdict.is_right}

    def _by_fine_grids(self, runs):
        """Compare cells with their physical problem at dx/2, which runs for the cheapest first."""
        cheapest_first = dict(sorted(runs.items(), key=lambda item: item[1].cost.cpu))
        fine, verdicts = self._companions(cheapest_first, FINE), {}
        for cell, run in runs.items():
            reference = fine[physical(cell)]
            if self._tears(reference):
                verdicts[cell] = torn_verdict(run, f"at dx/2: {reference.tear}")
            elif reference.finished:
                verdicts[cell] = self._compared(run, reference, cell, AT_FINE)
            else:
                verdicts[cell] = self._unchecked(run, reference)
        return verdicts | self._with_coarse_errors(verdicts, fine)

    def _with_coarse_errors(self, verdicts, fine):
        """Return the verdicts that are wrong, with the error of their runs at 2 dx and the limit
        that follows from it; fine: the runs at dx/2 of {physical cell}.
        """
        wrong = {cell: one for cell, one in verdicts.items()
                 if one is not None and one.outcome == WRONG}
        coarse = self._companions(wrong, COARSE)
        named = {}
        for cell, one in wrong.items():
            own = physical(cell)
            error = self._differences(coarse[own], fine[own], False)[one.quantity]
            is_setting = own != cell and own in self.verdicts and self.verdicts[own].is_right
            limit = VANISHING if one.limit == VANISHING else limit_of(one.error, error, is_setting)
            named[cell] = replace(one, coarse_error=error, limit=limit)
        return named

    def _companions(self, cells, dx):
        """Return {physical cell: `RunObservation` at dx times a factor}."""
        words = {COARSE: "2 dx", FINE: "dx/2"}[dx]
        return self._observe({cell: (cell, dx, self._most(dx), f"{cell_text(cell)}, {words}")
                              for cell in dict.fromkeys(map(physical, cells))})

    def _observe(self, wanted):
        """Return {key: `RunObservation`} of {key: (cell, factor of dx, most CPU time, label)}."""
        requests = {label: RunRequest(self.scenes.scene(cell, dx), most,
                                      probes=self.scenes.probes(cell))
                    for cell, dx, most, label in wanted.values()}
        runs = self.runs.observe(requests)
        self.cpu += float(np.nansum([run.cost.cpu for run in runs.values()]))
        return {key: runs[label] for key, (*_, label) in wanted.items()}

    def _most(self, dx):
        """Return the CPU time [s] that a run at dx times a factor may take."""
        cpu = self.base[1.0 if dx == COARSE else dx].cost.cpu
        return max(MOST_LONGER * np.nan_to_num(cpu), LEAST_CPU)

    # verdicts

    def _unfinished(self, run, most):
        """Return the verdict on a run that did not finish; None where the budget ended it."""
        if is_late(run, most):
            return None
        return CellVerdict(run.outcome, run.message, cpu=run.cost.cpu, steps=run.cost.steps,
                           until=run.until)

    def _unchecked(self, run, reference):
        """Return the verdict on a run whose reference did not finish."""
        if is_late(reference, self._most(FINE)):
            return None
        return CellVerdict(UNCHECKED, f"the reference at dx/2: {reference.outcome}: "
                           f"{reference.message}", cpu=run.cost.cpu, steps=run.cost.steps,
                           until=run.until)

    def _compared(self, run, reference, cell, text):
        """Return RIGHT or WRONG of a run beside a reference."""
        shifted = any(AXIS[name].name == "origin" for name, _ in cell)
        errors = self._differences(run, reference, shifted)
        shares = {name: self._scale(name, reference) / self._scale(name, self.base[FINE])
                  for name in errors}
        worst = self._worst(errors, shares)
        error, tolerance, share = errors[worst], self.tolerance[worst], shares[worst]
        outcome = RIGHT if error <= tolerance else WRONG
        limit = limit_of(error, np.nan, not physical(cell)) if outcome == WRONG else ""
        if outcome == WRONG and vanishes(error, share, tolerance):
            limit = VANISHING
        return CellVerdict(outcome, "", error, tolerance, worst, text, run.cost.cpu,
                           run.cost.steps, run.until, run.warnings, limit,
                           indicators=run.indicators, share=share)

    def _worst(self, errors, shares):
        """Return the quantity that is farthest past its tolerance: one that nearly vanishes only
        where no other is past it.
        """
        def rank(name):
            error, tolerance = errors[name], self.tolerance[name]
            is_past = error > tolerance and not vanishes(error, shares[name], tolerance)
            return is_past, error / tolerance
        return max(errors, key=rank)

    def _differences(self, run, reference, shifted):
        """Return {quantity: largest relative difference of two runs}."""
        errors = {text: differences(run.values[text], reference.values[text], shifted,
                                    self._scale(text, reference))
                  for text in self.quantities}
        return {text: float(error[-1] if OutputQuantity(text).at_end else error.max())
                for text, error in errors.items()}

    def _scale(self, text, reference):
        """Return the largest change of a quantity in a reference, or in the scene as given where
        it is zero throughout the reference.
        """
        values = reference.values[text]
        return largest_change(values if values.any() else self.base[FINE].values[text])


def torn_verdict(run, sentence):
    """Return the verdict on a run with the sentence on the body that tore."""
    return CellVerdict(TORN, sentence, cpu=run.cost.cpu, steps=run.cost.steps, until=run.until,
                       warnings=run.warnings)


def differences(values, reference, shifted, scale=None):
    """Return the differences (T,) of values (T, k), relative to a scale, the largest change of the
    reference by default; infinite where they cannot be compared.

    shifted: whether the changes since the start are compared.
    """
    scale = largest_change(reference) if scale is None else scale
    if shifted:
        values, reference = values - values[0], reference - reference[0]
    error = relative_difference(values, reference, scale)
    return np.where(np.isnan(error), np.inf, error)


def is_late(run, most):
    """Return whether the budget stopped a run, not the CPU time [s] that it might take."""
    return run.outcome == STOPPED and not run.cost.cpu >= BUDGET * most
