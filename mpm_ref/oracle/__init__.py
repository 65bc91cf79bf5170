"""Golden files: the arrays of every stage of a step, each with its error, to check other codes by.

    record(problem, "golden.h5", steps=3)                    # or record_adjoint, with gradients
    write("other.h5", [{"nodes": .., "mass": .., "ball/v": ..}, ..])      # the other code's arrays
    report = check("golden.h5", "other.h5")
    print(report)                  # "agrees: ..", or the first stage that departs and where

docs/reference/golden-files.md has the layout of the files and the rule for the tolerances.

Modules: `schema` lists the stages and arrays, `golden_file` writes the files, `comparison` and
`report` check other codes. Steps are recorded by `recording` (explicit), `adjoint_recording`
(gradients) and `implicit_recording` with `accepted_step` (implicit), the kernels' stages being
those of `kernel_stages`. The references are the plain twins: `plain_twin`, `plain_adjoint` (with
`plain_adjoint_transfer` and `plain_adjoint_laws`) and `implicit_twin` (with `differential`);
`error_bounds` measures the effect of round-off with them.
"""

from .comparison import NotComparable, check
from .golden_file import record, record_adjoint, write
from .report import CheckReport, Departure

__all__ = ["CheckReport", "Departure", "NotComparable", "check", "record", "record_adjoint",
           "write"]
