"""NCLaw's Tables 4 and 7: errors of one environment, which Tables 1 and 2 have too.

They are recorded with those, from the same runs. Table 4 is of plasticine ("more recent
comparison"). Table 7 (water, "auxiliary loss") has laws that were trained without and with a term
of velocities in the loss, whose weight is not printed; the errors are those of positions.
"""

from typing import NamedTuple

from .errors import OURS, grouped, record_mean
from .trained_laws import nets

NOT_RUN = "Table 4: the simulator of Li & Farimani (2022) is another paper's and is not run"


class Excerpt(NamedTuple):
    """A table of one environment."""

    environment: str
    methods: dict       # column -> method


EXCERPTS = {"nclaw.table4": Excerpt("plasticine", {"ours": OURS, "gnn": "gnn"}),
            "nclaw.table7": Excerpt("water", {"without": OURS, "with": "velocity"})}


def record_excerpts(run, rows):
    """Record what these tables have of the errors of methods, `errors.Row`s."""
    for table, (environment, methods) in EXCERPTS.items():
        for column, method in methods.items():
            mine = [row for row in rows if (row.environment, row.method) == (environment, method)]
            for (_, task), some in grouped(mine).items():
                record_mean(run, f"{table}.{task}.{column}", some,
                            nets().get(f"{environment}-{method}"))
