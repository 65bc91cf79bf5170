"""Search outward from a scene for its nearest failures, along each axis, then on pairs of axes.

Along each direction of each axis the factors of `axes.searched_rungs` are tried from 1 outward
until one is not right. Between the last good factor and the first bad one, the interval is halved
in the logarithm until it spans at most `NARROW`. A failure between two good rungs is not found. All
directions have their first factors tried together, then those nearest to 1 go first: the intervals
of the nearest failures, and then what lies farther out. Where several are equally near, the
directions that have cost least so far go first.

The farthest good factor of a direction must be right beside the grid of half the spacing. If it is
not, the direction goes back to 1, and all its factors are compared with that grid.

A bad factor whose run is too long or not checked ends its direction without halving: that is the
end of what was looked at, no failure of the scene.

A cell of a pair that one of its axes alone refuses, by the same message and before any run, is
known and not judged.
"""

from dataclasses import dataclass
from itertools import combinations
from math import ceil, inf, isnan, log2, log10, sqrt

from ..sweep.observation import STOPPED
from .axes import DOWN, UP, applicable, is_discrete, searched_rungs
from .cell import cell_of
from .verdict import UNCHECKED, WRONG, CellVerdict

NARROW = 1.1            # ratio of the first bad to the last good factor
NARROW_SHIFT = 2.0      # of a shift's
EVEN = 1e-9             # of a halving, which round-off may leave
DIGITS = 9              # of decades, within which factors are equally near
PER_WORKER = 2          # cells of a round, so that few of several workers wait for the last one
WIDEST = 3              # axes whose pairs are mapped
SIDE = 5                # factors of an axis on a map


@dataclass
class Direction:
    """The search along one direction of an axis."""

    axis: object                        # `axes.ScaleAxis`
    direction: str                      # DOWN or UP
    rungs: tuple                        # factors, from 1 outward
    is_discrete: bool
    good: float = 1.0                   # the farthest factor that is right
    bad: float | None = None            # the nearest one that is not
    verdict: CellVerdict | None = None  # on the bad one
    is_late: bool = False               # whether the budget ended the search
    late: float | None = None           # the factor that it left without a verdict
    by_fine_grids: bool = False         # whether agreement with coarse grids does not suffice
    cpu: float = 0.0                    # [s] of its runs so far

    @property
    def failed(self):
        """Return whether the bad factor is a failure, not the end of what was looked at."""
        return self.verdict is not None and self.verdict.outcome not in (STOPPED, UNCHECKED)

    @property
    def margin(self):
        """Return the factor > 1 by which the axis may change in this direction."""
        return max(self.good, 1.0 / self.good)

    @property
    def is_new(self):
        """Return whether no factor has been tried."""
        return self.good == 1.0 and self.bad is None and not self.is_late

    def next_factor(self):
        """Return the factor to be tried next, or None at the end of the search."""
        if self.is_late:
            return None
        if self.bad is None:
            return next(iter(self.rungs_left()), None)
        return sqrt(self.good * self.bad) if self.halvings() else None

    @property
    def is_unconfirmed(self):
        """Return whether the farthest good factor is still to be compared with a fine grid."""
        return not (self.by_fine_grids or self.is_late or self.good == 1.0)

    def confirm(self, verdict):
        """Take the verdict by a fine grid on the farthest good factor; where it is wrong, the
        search begins anew between 1 and that factor.
        """
        self.by_fine_grids = True
        if verdict is None:
            self.is_late = True
        elif not verdict.is_right and verdict.outcome != UNCHECKED:
            self.good, self.bad, self.verdict = 1.0, self.good, verdict

    def rungs_left(self):
        """Return the rungs past the last good factor."""
        return [factor for factor in self.rungs if abs(log10(factor)) > abs(log10(self.good))]

    def halvings(self):
        """Return the number of factors between the last good and the bad one that narrow the
        interval down.
        """
        if self.is_discrete or not self.failed:
            return 0
        narrow = NARROW_SHIFT if self.axis.name == "origin" else NARROW
        return max(ceil(log2(abs(log10(self.bad / self.good)) / log10(narrow)) - EVEN), 0)

    def remaining(self):
        """Return about how many factors are missing to the end of the search."""
        return len(self.rungs_left()) if self.bad is None else self.halvings()

    def note(self, factor, verdict):
        """Take the verdict on the factor that was tried; None ends the search as late."""
        self.cpu += 0.0 if verdict is None or isnan(verdict.cpu) else verdict.cpu
        if verdict is None:
            self.is_late, self.late = True, factor
        elif verdict.is_right:
            self.good = factor
        else:
            self.bad, self.verdict = factor, verdict


@dataclass(frozen=True)
class PairMap:
    """The verdicts on a pair of axes: verdicts[i][j] with factors[0][i] and factors[1][j]."""

    axes: tuple         # of two `axes.ScaleAxis`
    factors: tuple      # of two tuples of factors, each increasing
    verdicts: tuple     # of tuples of `CellVerdict`, None where the budget ended first


class LimitsSearch:
    """All directions and maps of a search."""

    def __init__(self, judge):
        """Prepare a search by a `verdict.CellJudge`."""
        self.judge = judge
        tables = judge.scenes.tables()
        self.axes, self.left_out = applicable(tables, judge.quantities)
        self.directions = [
            Direction(axis, direction, factors, is_discrete(axis, direction))
            for axis in self.axes for direction in (DOWN, UP)
            if (factors := searched_rungs(axis, tables, direction))]
        self.maps = []

    def run(self):
        """Search along all directions, then on the pairs of the axes with the nearest failures."""
        explore(self.directions, self.judge.judge, self.judge.runs.workers)
        for pair in combinations(nearest_axes(self.directions), 2):
            self.maps.append(self._mapped(pair))

    def _mapped(self, pair):
        """Return the `PairMap` of two axes."""
        factors = tuple(map_factors([one for one in self.directions if one.axis is axis])
                        for axis in pair)
        cells = [[cell_of({pair[0].name: a, pair[1].name: b}) for b in factors[1]]
                 for a in factors[0]]
        known = {cell: verdict for row in cells for cell in row
                 if (verdict := self.judge.refused_alone(cell)) is not None}
        verdicts = known | self.judge.judge([cell for row in cells for cell in row
                                             if cell not in known])
        return PairMap(pair, factors, tuple(tuple(verdicts[cell] for cell in row)
                                            for row in cells))

    def remaining(self):
        """Return about how many cells the budget has left out."""
        return sum(one.remaining() for one in self.directions) + sum(
            verdict is None for one in self.maps for row in one.verdicts for verdict in row)

    def wrong_cells(self):
        """Return the cells that finished with a wrong result, each with its verdict."""
        return {cell: verdict for cell, verdict in self.judge.verdicts.items()
                if verdict.outcome == WRONG}


def explore(directions, judge, workers=1):
    """Move all directions on to their ends: the first factors of all of them together, then the
    factors nearest to 1 first.

    judge(cells, by_fine_grids) returns {cell: verdict}; see `verdict.CellJudge.judge`.
    workers: runs at a time.
    """
    while True:
        factors = next_factors(directions)
        if not factors and not confirm(directions, judge):
            return
        new = [pair for pair in factors if pair[0].is_new]
        factors = new or factors[:PER_WORKER * workers if workers > 1 else 1]
        for strict in (False, True):
            chosen = [pair for pair in factors if pair[0].by_fine_grids == strict]
            cells = [cell_of({one.axis.name: factor}) for one, factor in chosen]
            verdicts = judge(cells, strict) if cells else {}
            for (one, factor), cell in zip(chosen, cells, strict=True):
                one.note(factor, verdicts[cell])


def next_factors(directions):
    """Return (direction, factor to be tried next) of all directions that go on, nearest to 1 first,
    and of equally near ones that which has cost least.
    """
    factors = [(one, factor) for one in directions if (factor := one.next_factor()) is not None]
    return sorted(factors, key=lambda pair: (round(abs(log10(pair[1])), DIGITS), pair[0].cpu))


def confirm(directions, judge):
    """Compare the farthest good factors of directions with fine grids; return whether there were
    any left.
    """
    chosen = [one for one in directions if one.is_unconfirmed]
    cells = [cell_of({one.axis.name: one.good}) for one in chosen]
    verdicts = judge(cells, True) if cells else {}
    for one, cell in zip(chosen, cells, strict=True):
        one.confirm(verdicts[cell])
    return bool(chosen)


def nearest_axes(directions, most=WIDEST):
    """Return the axes with the nearest bad factors, nearest first, at most so many."""
    distances = {}
    for one in directions:
        if one.failed:
            distances.setdefault(one.axis.name, (inf, one.axis))
            distances[one.axis.name] = min(distances[one.axis.name],
                                           (abs(log10(one.bad)), one.axis),
                                         key=lambda pair: pair[0])
    return [axis for _, axis in sorted(distances.values(), key=lambda pair: pair[0])][:most]


def map_factors(directions):
    """Return at most `SIDE` increasing factors of an axis: 1, the nearest bad factor (or the
    farthest good one) in each direction, and one between.
    """
    factors = {1.0}
    for one in directions:
        end = one.bad if one.bad is not None else one.good
        middle = [f for f in one.rungs if abs(log10(f)) < abs(log10(end))][-1:] \
            if one.is_discrete else [sqrt(end)]
        factors |= {end, *middle}
    return tuple(sorted(factors))
