"""Resume runs whose files have a flipped bit, in this process, which HDF5 may end.

    python tests/support/damaged_runs.py FOLDER SEED CASES

FOLDER holds scene.toml, run.h5 and run.checkpoint.h5 of a run with a step limit. Prints one line of
JSON for each case before it is tried, [file, byte, bit], and its exit status and stderr after it.
"""

import json
import random
import shutil
import sys
import tempfile
from pathlib import Path

from typer.testing import CliRunner

FILES = "run.h5", "run.checkpoint.h5"
FIRST = ("run.h5", 5579)        # where a flipped bit ended a process, before files had checksums


def flips(folder, seed, count):
    """Yield (name of a file, byte, bit): the bits of FIRST, then random ones."""
    yield from ((*FIRST, bit) for bit in range(8))
    rng = random.Random(seed)
    for _ in range(count):
        name = rng.choice(FILES)
        yield name, rng.randrange((folder / name).stat().st_size), rng.randrange(8)


def resume(folder, steps):
    """Exit status and stderr of a resumed run; an exception is a fault of ours."""
    from mpm_ref.cli import app

    done = CliRunner().invoke(app, ["run", str(folder / "scene.toml"), "--out",
                                    str(folder / "run.h5"), "--resume", "--quiet", "--steps",
                                    str(steps)])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return "traceback", repr(done.exception)
    return done.exit_code, done.stderr


def main(folder, seed, count):
    """Try all cases."""
    with tempfile.TemporaryDirectory() as place:
        for name, at, bit in flips(folder, seed, count):
            shutil.copytree(folder, place, dirs_exist_ok=True)
            content = bytearray((folder / name).read_bytes())
            content[at] ^= 1 << bit
            (Path(place) / name).write_bytes(content)
            print(json.dumps([name, at, bit]), flush=True)
            print(json.dumps(resume(Path(place), 13)), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
