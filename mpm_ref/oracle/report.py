"""The report of a check, as a sentence for people and as JSON for programs."""

import json
from dataclasses import asdict, dataclass

from ..store.text import counted


@dataclass(frozen=True)
class Departure:
    """The entry of one array that is farthest off, in units of its tolerance."""

    step: int
    stage: str
    array: str              # key of the array, e.g. "mass" or "ball/x"
    where: str = ""         # node, particle and component, in words
    golden: float | None = None
    other: float | None = None
    difference: float | None = None
    tolerance: float | None = None
    what: str = ""          # a sentence instead, if there are no numbers to show

    @property
    def sentence(self):
        """Return the place and the size of the departure in words."""
        place = f"step {self.step}, stage {self.stage}, array {self.array}"
        if self.what:
            return f"{place}: {self.what}"
        return (f"{place}: {self.where} is {self.other:.17g}, but {self.golden:.17g} in the golden "
                f"file; the difference {self.difference:.3g} is {self._excess}")

    @property
    def _excess(self):
        """The difference over the tolerance in words; the tolerance is 0 if only 0 is right."""
        if self.tolerance == 0.0:
            return "more than its tolerance, 0"
        return f"{self.difference / self.tolerance:.3g} times its tolerance {self.tolerance:.3g}"


@dataclass(frozen=True)
class CheckReport:
    """The result of comparing another code's arrays with a golden file."""

    agrees: bool            # no array departs, and at least one was compared
    precision: str          # "f64" or "f32"
    steps: tuple            # number of steps given, and of steps in the golden file
    compared: int           # number of arrays
    nearest: float          # largest difference of an array that agrees, over its tolerance
    departures: tuple       # of `Departure`, one for each array that departs, first stage first
    missing: tuple          # arrays and steps of the golden file that the other code did not give
    unknown: tuple          # arrays and steps that the golden file does not have

    @property
    def first(self):
        """Return the first `Departure`, or None."""
        return self.departures[0] if self.departures else None

    @property
    def json(self):
        """Return the report as JSON text."""
        return json.dumps({**asdict(self), "sentence": str(self)}, indent=2)

    def __str__(self):
        rest = f"; not given: {', '.join(self.missing)}" if self.missing else ""
        rest += f"; unknown: {', '.join(self.unknown)}" if self.unknown else ""
        if self.agrees:
            given, recorded = self.steps
            partly = f" as far as given ({given} of {recorded} steps)" if given < recorded else ""
            arrays = counted(self.compared, "array")
            return (f"agrees{partly}: {arrays} at {self.precision} tolerance; the largest "
                    f"difference is {self.nearest:.2g} of its tolerance{rest}")
        if not self.first:
            return f"nothing to compare{rest}"
        return (f"departs first at {self.first.sentence} ({self.precision}); "
                f"{len(self.departures)} of {counted(self.compared, 'array')} "
                f"{'departs' if len(self.departures) == 1 else 'depart'}{rest}")
