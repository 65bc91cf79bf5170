"""Implement `mpm-ref needs`: which ingredients of a scene its quantities of interest require.

Exit status: 0 the answer; 1 no full answer within the budget; 2 the scene or the options do not
fit; 4 a file could not be written; 130 Ctrl-C.
"""

import shlex
from typing import NamedTuple

import typer

from ..needs.answer import NeedsAnswer, lean_text
from ..needs.code_parts import code_parts
from ..needs.removal import RemovalStudy
from ..needs.variant import first_variant
from ..store.atomic import write_bytes
from .errors import INTERRUPT, end, exit_on_errors, options
from .options import Json, SceneName
from .sweep_options import (
    BudgetOption,
    ErrorOption,
    OutOption,
    QuantityOption,
    QuietOption,
    SchedulerOption,
    SweepRequest,
    WorkersOption,
    load_sweep,
    observed_of,
    open_runs,
    parse_budget,
    parse_error,
    parse_quantities,
    parse_workers,
)
from .terminal import as_json
