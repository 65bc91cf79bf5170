"""Golden files: every stage of a step, with the error of each number, to check others by.

    record(problem, "golden.h5", steps=3)                    # or record_adjoint, with gradients
    write("other.h5", [{"nodes": .., "mass": .., "ball/v": ..}, ..])      # the other code's arrays
    report = check("golden.h5", "other.h5")
    print(report)                  # "agrees: ..", or the first stage that departs and where

docs/reference/golden-files.md has the layout of the files and the rule for the tolerances.
"""

from .comparison import NotComparable, check
from .golden_file import record, record_adjoint, write
from .report import Departure, Report

__all__ = ["Departure", "NotComparable", "Report", "check", "record", "record_adjoint", "write"]
