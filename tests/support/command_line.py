"""The command line called in this process, on a small scene."""

from typer.testing import CliRunner

from mpm_ref.cli import app

SCENE = """
title = "Disk"
dim = 2
dx = 0.05
dt = 0.001
steps = 40
every = 10
gravity = [0.0, -9.8]
seed = 5

[[body]]
name = "disk"
density = 1000.0
shape = { type = "sphere", center = [0.5, 0.3], radius = 0.1 }
sampling = { type = "regular", per_cell = 2 }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }
"""


def mpm_ref(*arguments):
    """What the command line answers: exit code, output, errors."""
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done


def assert_told(done, code, *words):
    """One sentence on the error channel, and no traceback."""
    assert done.exit_code == code
    assert done.stderr.startswith("mpm-ref: ")
    assert done.stderr.count("\n") == 1
    for word in words:
        assert word in done.stderr
