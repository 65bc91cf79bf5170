"""Common parts of the validation suite: records, runs, reports, printed numbers."""
