"""Only what trains needs torch: without it all else loads and both command lines answer."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BLOCKED = "import sys; sys.modules['torch'] = None\n"        # any `import torch` raises ImportError

IMPORT_ALL = BLOCKED + """
import importlib, pkgutil, mpm_ref
for module in pkgutil.walk_packages(mpm_ref.__path__, "mpm_ref."):
    if ".train" not in module.name:
        importlib.import_module(module.name)
"""
HELP = BLOCKED + """
sys.argv = ["mpm-ref", "--help"]
from mpm_ref.cli import main
main()
"""
LIST = BLOCKED + """
import runpy
sys.argv = ["validation", "list"]
runpy.run_module("validation", run_name="__main__")
"""


def python(code):
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)


@pytest.mark.parametrize("code", [IMPORT_ALL, HELP, LIST], ids=["import", "cli help", "validation"])
def test_runs_without_torch(code):
    done = python(code)
    assert done.returncode == 0, done.stderr


def test_block_works():
    done = python(BLOCKED + "import torch")
    assert done.returncode == 1
    assert "ModuleNotFoundError" in done.stderr
