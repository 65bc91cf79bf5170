"""The validation suite: published and analytic numbers beside ours.

    python -m validation list | run ID... --profile P | report | status

One experiment is one function in ``validation/<group>/``, made known by `experiment`; what it
records is judged in `record`, kept in ``results/<profile>/`` and put together by `report`.
"""

from .common.record import Measurement
from .common.registry import experiment
from .common.results import ProfileResults
from .common.run import Run

__all__ = ["Measurement", "ProfileResults", "Run", "experiment"]
