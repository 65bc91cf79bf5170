"""What a check found, for a person and for a machine."""

import json
from dataclasses import asdict, dataclass

from ..store.words import counted


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
    what: str = ""          # said instead where there are no numbers to show

    @property
    def sentence(self):
        """Where and by how much."""
        at = f"step {self.step}, stage {self.stage}, array {self.array}"
        if self.what:
            return f"{at}: {self.what}"
        return (f"{at}: {self.where} is {self.other:.17g} where the golden file has "
                f"{self.golden:.17g}; the difference {self.difference:.3g} is {self._excess}")

    @property
    def _excess(self):
        """The difference against the tolerance, which is 0 where only 0 can be right."""
        if self.tolerance == 0.0:
            return "more than its tolerance, 0"
        return f"{self.difference / self.tolerance:.3g} times its tolerance {self.tolerance:.3g}"


@dataclass(frozen=True)
class Report:
    """Whether another code's arrays agree with a golden file, and where they first do not."""

    agrees: bool
    precision: str          # "f64" or "f32"
    steps: tuple            # how many were given, of how many
    compared: int           # arrays
    nearest: float          # largest difference of an array that agrees, over its tolerance
    departures: tuple       # of Departure, one for each array that departs, first stage first
    missing: tuple          # what the golden file has and the other has not, not compared
    unknown: tuple          # the reverse

    @property
    def first(self):
        """The first `Departure`, or None."""
        return self.departures[0] if self.departures else None

    @property
    def json(self):
        """The report as JSON text."""
        return json.dumps({**asdict(self), "sentence": str(self)}, indent=2)

    def __str__(self):
        rest = f"; not given: {', '.join(self.missing)}" if self.missing else ""
        rest += f"; unknown: {', '.join(self.unknown)}" if self.unknown else ""
        if self.agrees:
            given, recorded = self.steps
            partly = f" as far as given ({given} of {recorded} steps)" if given < recorded else ""
            arrays = counted(self.compared, "array")
            return (f"agrees{partly}: {arrays} at {self.precision} tolerance, the "
                    f"largest difference is {self.nearest:.2g} of its tolerance{rest}")
        if not self.first:
            return f"nothing to compare{rest}"
        return (f"departs first at {self.first.sentence} ({self.precision}); "
                f"{len(self.departures)} of {counted(self.compared, 'array')} "
                f"{'departs' if len(self.departures) == 1 else 'depart'}{rest}")
