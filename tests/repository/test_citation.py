"""CITATION.cff says what the package says of itself."""

from pathlib import Path

import yaml

import mpm_ref

ROOT = Path(__file__).parents[2]


def test_the_citation_is_of_this_version_and_licence():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == mpm_ref.__version__
    assert citation["license"] == "MIT"
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
