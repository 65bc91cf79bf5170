"""The reading side of ``results/<profile>/``: records and tables of one profile."""

import csv
from pathlib import Path

import numpy as np

from .record import read_records

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "results"


class ProfileResults:
    """The records and tables of one profile, in a folder."""

    def __init__(self, folder):
        self.folder = Path(folder)

    def ids(self):
        """Ids of the experiments with results."""
        return sorted(file.stem for file in self.folder.glob("*.json"))

    def records(self, experiment):
        """Return all `Measurement`s of an experiment; FileNotFoundError if it has not been run."""
        file = self.folder / f"{experiment}.json"
        if not file.exists():
            raise FileNotFoundError(f"no results of {experiment} in {self.folder}; "
                                    "run the experiment")
        return read_records(file)

    def value(self, experiment, target):
        """The value that an experiment recorded for one target; KeyError where there is none."""
        for record in self.records(experiment):
            if record.target == target:
                return record.value
        raise KeyError(f"{experiment} recorded no {target}")

    def tables(self, experiment):
        """Names of the tables that an experiment wrote."""
        files = self.folder.glob(f"{experiment}.*.csv")
        names = (file.stem.removeprefix(f"{experiment}.") for file in files)
        return sorted(name for name in names if "." not in name)

    def table_bytes(self, experiment):
        """Return {name: content of the file} of the tables that an experiment wrote."""
        return {name: (self.folder / f"{experiment}.{name}.csv").read_bytes()
                for name in self.tables(experiment)}

    def rows(self, experiment, name):
        """A table as its list of column names and its rows of text."""
        with open(self.folder / f"{experiment}.{name}.csv", newline="") as file:
            header, *rows = csv.reader(file)
        return header, rows

    def table(self, experiment, name):
        """A table as {column: array}, numbers where the whole column is numeric, text otherwise."""
        header, rows = self.rows(experiment, name)
        return {column: _array([row[k] for row in rows]) for k, column in enumerate(header)}


def _array(texts):
    try:
        return np.array([float(text) for text in texts])
    except ValueError:
        return np.array(texts)
