"""Mutated scenes, studies and files, given to `mpm-ref info` and `oracle check` in one process.

    python tests/support/fuzz.py FOLDER SEED CASES

prints JSON: a list of the cases that ended with a traceback, took too long or said too much.
FOLDER holds the files to mutate: texts in TOML, and binary files.
"""

import json
import random
import resource
import signal
import sys
import time
import traceback
from pathlib import Path

from typer.testing import CliRunner

SECONDS = 30                    # of a case
MEMORY = 6 << 30                # bytes of addresses beyond those of the start
SAID = 3000                     # characters on stderr
VALUES = ["1e30", "-1", "0", "nan", "inf", "1e-300", '"text"', "[]", "{}", "true", "1e400",
          "99999999999999999999", "[1e9, 1e9]", '"' + "x" * 100_000 + '"', "[" * 400 + "]" * 400,
          '"../none.npz"', '"/dev/zero"', "2.0", "-0.3", "[0.1, 0.2, 0.3]", '"\\u0000"']
WORDS = ["law", "shape", "type", "dim", "dx", "material", "[[body]]", "[map]", "[[parameter]]", "E",
         "radius", "center", "friction", "weights", "file", "per_cell", "kind", "r", "runs"]


class TooLong(Exception):
    """A case takes more than `SECONDS`."""


def mutated_text(text, rng):
    """Return a text in which some lines, values or characters are others."""
    lines = text.splitlines()
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        k = rng.randrange(len(lines))
        how = rng.randrange(8)
        key, sign, value = lines[k].partition("=")
        if how == 0:
            del lines[k]
        elif how == 1:
            lines.insert(k, rng.choice(lines))
        elif how in (2, 3) and sign:
            lines[k] = f"{key}= {rng.choice(VALUES)}"
        elif how == 4:
            lines[k] = lines[k].replace(rng.choice(WORDS), rng.choice(WORDS))
        elif how == 5 and sign:
            parts = value.replace("[", " [ ").replace(",", " , ").replace("]", " ] ").split()
            if parts:
                parts[rng.randrange(len(parts))] = rng.choice(VALUES)
            lines[k] = f"{key}= {' '.join(parts)}"
        elif how == 6 and lines[k]:
            at = rng.randrange(len(lines[k]))
            lines[k] = lines[k][:at] + chr(rng.randrange(1, 300)) + lines[k][at + 1:]
        else:
            lines[k] = lines[k][:rng.randrange(len(lines[k]) + 1)]
        lines = lines or [""]
    return "\n".join(lines).encode()


def mutated_bytes(content, rng):
    """Return bytes of which some are others, missing or added."""
    content = bytearray(content)
    for _ in range(rng.choice((1, 1, 3))):
        at, how = rng.randrange(len(content)), rng.randrange(6)
        if how < 3:
            content[at] ^= 1 << rng.randrange(8)
        elif how == 3:
            content[at:at + 64] = bytes(64)
        elif how == 4:
            del content[at:]
        else:
            content[at:at] = rng.randbytes(16)
        content = content or bytearray(1)
    return bytes(content)


def cases(folder, seed, count):
    """Yield (name of the file, its mutated content)."""
    rng = random.Random(seed)
    files = sorted(folder.iterdir())
    for _ in range(count):
        file = rng.choice(files)
        content = file.read_bytes()
        is_text = file.suffix == ".toml"
        yield file.name, mutated_text(content.decode(), rng) if is_text else mutated_bytes(
            content, rng)


def commands(path, folder):
    """Return the commands that read a file."""
    if path.name.startswith("golden"):
        return [["info", path], ["oracle", "check", path, folder / path.name]]
    return [["info", path]]


def answer_to(app, command, seconds=SECONDS):
    """Return the answer to a command, None where it takes longer."""
    signal.alarm(seconds)
    try:
        return CliRunner().invoke(app, [str(word) for word in command])
    except TooLong:
        return None
    finally:
        signal.alarm(0)


def fault_of(done, statuses=(0, 2, 3, 4)):
    """Return what is wrong with an answer, or None; statuses: of exits that are right."""
    if done is None:
        return "too long"
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return "".join(traceback.format_exception(done.exception))[-2000:]
    if done.exit_code not in statuses:
        return f"exit status {done.exit_code}: {done.stderr[-500:]}"
    if len(done.stderr) > SAID:
        return f"{len(done.stderr)} characters on stderr"
    return None


def main(folder, seed, count):
    """Print the faults of `count` cases as JSON."""
    from mpm_ref.cli import app

    def too_long(*_):
        raise TooLong

    signal.signal(signal.SIGALRM, too_long)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    faults, place = [], folder.parent / "mutated"
    place.mkdir(exist_ok=True)
    for k, (name, content) in enumerate(cases(folder, seed, count)):
        path = place / name
        path.write_bytes(content)
        began = time.perf_counter()
        for command in commands(path, folder):
            if fault := fault_of(answer_to(app, command)):
                path.with_name(f"{k}-{name}").write_bytes(content)
                faults.append({"case": k, "file": name, "fault": fault,
                               "seconds": round(time.perf_counter() - began, 1)})
    print(json.dumps(faults, indent=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
