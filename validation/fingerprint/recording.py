"""Runs of cases, each under several numbers of threads, and files of their fingerprints."""

import json
from collections.abc import Callable
from fnmatch import fnmatch
from pathlib import Path
from time import process_time
from typing import NamedTuple

from .compare import entry_differences, fingerprint
from .library import threads
from .machine import machine

THREADS = (1, 2)
FORMAT = 1


class RunCase(NamedTuple):
    """A named run; `run()` returns its results as {label: nested values}."""

    name: str
    run: Callable


def selected(cases, pattern=None):
    """Return the cases whose names match a pattern such as "hot*"; all of them without one."""
    return [case for case in cases if pattern is None or fnmatch(case.name, pattern)]


def run_cases(cases, show=lambda name, entry: None):
    """Return {name: entry} of cases, and call show(name, entry) after each.

    An entry has `values` (the fingerprint under the first number of threads), `raises` (the
    exception, or None), `threads_differ` (what differs under another number) and `seconds` (CPU
    seconds under each number).
    """
    entries = {}
    for case in cases:
        attempts = [attempt(case, count) for count in THREADS]
        first = attempts[0]
        entry = {"values": first["values"], "raises": first["raises"],
                 "threads_differ": [label for other in attempts[1:]
                                    for label in entry_differences(first, other)],
                 "seconds": [round(one["seconds"], 2) for one in attempts]}
        entries[case.name] = entry
        show(case.name, entry)
    return entries


def attempt(case, count):
    """Return the fingerprint of a case under a number of threads, or the exception."""
    values, raises, start = {}, None, process_time()
    try:
        with threads(count):
            values = fingerprint(case.run())
    except Exception as error:
        raises = f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"
    return {"values": values, "raises": raises, "seconds": process_time() - start}


def write(path, entries):
    """Write a record of entries with the machine they were made on."""
    record = {"format": FORMAT, "machine": machine(), "threads": list(THREADS), "cases": entries}
    Path(path).write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def read(path):
    """Return a record that `write` wrote. Raises ValueError for another file."""
    record = json.loads(Path(path).read_text(encoding="utf-8"))
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise ValueError(f"{path}: expected a record of fingerprints of format {FORMAT}")
    return record
