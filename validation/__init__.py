"""The validation suite: published and analytic numbers beside ours.

    python -m validation list | run ID... --profile P | report | status

One experiment is one function in ``validation/<group>/``, made known by `experiment`; what it
records is judged in `record`, kept in ``results/<profile>/`` and put together by `report`.
"""

from .record import Record
from .registry import experiment
from .results import Results
from .run import Run

__all__ = ["Record", "Results", "Run", "experiment"]
