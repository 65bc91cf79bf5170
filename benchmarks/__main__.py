"""Run the benchmarks: `python -m benchmarks COMMAND`.

They compare mpm_ref with Taichi and Warp on an elastic block, forward and with a gradient, check
steps of both against golden files, measure the cost of each feature and of an implicit step, time
a sweep on several workers, and simulate many workers.
"""

import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
import threadpoolctl
import typer

from validation.common.provenance import commit, cpu_model

from .backends import RemoteBackend, make_backend
from .problem import block

app = typer.Typer(add_completion=False, no_args_is_help=True)
CELLS = {"10k": 11, "100k": 23, "1M": 50}
WARM_UP = 20        # steps before timing, after which the energies are compared
AGREE = 1e-12       # relative difference of the kinetic energies that is allowed


def compare(problem, names, threads, repeats):
    """Return the median wall and CPU ns per particle-step of each backend, and their energies.

    The backends are timed in turn.
    """
    backends = {name: RemoteBackend(name, problem, threads) for name in names}
    energies = {name: backend.run(WARM_UP)[2] for name, backend in backends.items()}
    per_round = max(1, round(300_000 / len(problem.x)))
    rounds = {name: [] for name in names}
    for _ in range(repeats):
        for name, backend in backends.items():
            rounds[name].append(backend.run(per_round)[:2])
    for backend in backends.values():
        backend.close()
    scale = 1e9 / (per_round * len(problem.x))
    times = {name: np.median(r, axis=0) * scale for name, r in rounds.items()}
    return times, energies


def disagreement(energies):
    """Return the largest relative difference of the energies."""
    values = np.array(list(energies.values()))
    return float(np.ptp(values) / np.abs(values).max())


@app.command()
def blocks(
    sizes: Annotated[str, typer.Option(help="of 10k, 100k, 1M, comma-separated")] = "10k,100k,1M",
    backends: Annotated[str, typer.Option()] = "mpm_ref,taichi,warp",
    threads: Annotated[int, typer.Option()] = 2,
    repeats: Annotated[int, typer.Option()] = 9,
    out: Annotated[Path, typer.Option()] = Path("results/benchmarks/block.json"),
):
    """Measure ns per particle-step of every backend, in lattice and shuffled order."""
    names, rows = backends.split(","), []
    for size in sizes.split(","):
        for shuffle in (False, True):
            problem = block(CELLS[size], shuffle)
            times, energies = compare(problem, names, threads, repeats)
            difference = disagreement(energies)
            if difference > AGREE:
                raise SystemExit(f"the backends disagree by {difference:.1e} > {AGREE}: {energies}")
            for name, (wall, cpu) in times.items():
                rows.append({
                    "size": size, "particles": len(problem.x), "shuffled": shuffle,
                    "backend": name, "wall_ns": wall, "cpu_ns": cpu,
                    "cpu_ratio_to_ours": cpu / times[names[0]][1], "disagreement": difference,
                })
                show(rows[-1])
    save(out, rows, threads, repeats)


def show(row):
    """Print a row of the table of backends."""
    order = "shuffled" if row["shuffled"] else "lattice"
    typer.echo(
        f"{row['size']:>5} {order:8} {row['backend']:8} wall {row['wall_ns']:7.1f} ns  "
        f"CPU {row['cpu_ns']:7.1f} ns  x {row['cpu_ratio_to_ours']:.2f} of ours"
    )


def save(out, rows, threads, repeats, **conditions):
    """Write the rows with the conditions of the measurement."""
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps({
        "command": "python -m benchmarks " + " ".join(without_out(sys.argv[1:])),
        "commit": commit(Path(__file__).parents[1]),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": platform.machine(), "cpu": cpu_model(), "cores": os.cpu_count(),
        "threads": threads, "repeats": repeats, **conditions, "rows": rows,
    }, indent=1) + "\n")
    typer.echo(f"wrote {out}")


def without_out(arguments):
    """Return the arguments of a command without its output file, a path of one machine."""
    kept = list(arguments)
    while "--out" in kept:
        k = kept.index("--out")
        del kept[k:k + 2]
    return [one for one in kept if not one.startswith("--out=")]


@app.command()
def gradients(
    sizes: Annotated[str, typer.Option(help="of 10k, 100k, 1M, comma-separated")] = "10k,100k",
    backends: Annotated[str, typer.Option()] = "mpm_ref,taichi,warp",
    steps: Annotated[int, typer.Option(help="through which a gradient goes")] = 8,
    threads: Annotated[int, typer.Option()] = 2,
    repeats: Annotated[int, typer.Option()] = 9,
    out: Annotated[Path, typer.Option()] = Path("results/benchmarks/gradients.json"),
):
    """Measure ns per particle-step of runs with a gradient and without one, of every backend."""
    from .gradients import gradient_line, gradient_rows

    rows = []
    for size in sizes.split(","):
        problem = block(CELLS[size])
        for row in gradient_rows(problem, backends.split(","), steps, threads, repeats):
            rows.append({"size": size} | row)
            typer.echo(gradient_line(rows[-1]))
    save(out, rows, threads, repeats)


@app.command()
def conformance(
    backends: Annotated[str, typer.Option()] = "taichi,warp",
    out: Annotated[Path, typer.Option()] = Path("results/benchmarks/conformance.json"),
):
    """Check steps of Taichi and Warp, and gradients of Warp's tape, stage by stage."""
    from .conformance import conformance_rows, require_installed, versions
    from .conformance_table import adjoint_table, departure_lines, report_line, stage_table

    names, rows = backends.split(","), []
    try:
        require_installed(names)
    except ValueError as error:
        typer.echo(f"{error}", err=True)
        raise typer.Exit(2) from None
    for row in conformance_rows(names):
        rows.append(row)
        typer.echo(report_line(row))
    for lines in (stage_table(rows), adjoint_table(rows), departure_lines(rows)):
        typer.echo("\n" + "\n".join(lines))
    save(out, rows, 1, 1, versions=versions(names))


@app.command()
def features(
    threads: int = 2, repeats: int = 9, out: Path = Path("results/benchmarks/features.json")
):
    """Measure ns per particle-step and bytes per particle of each feature, on the block of 100k."""
    from .features import costs

    rows = costs(block(CELLS["100k"]), threads, repeats)
    for row in rows:
        typer.echo(
            f"{row['feature']:34} wall {row['wall_ns']:7.1f} ns  CPU {row['cpu_ns']:7.1f} ns  "
            f"x {row['cpu_ratio']:.2f}  {row['state_bytes_per_particle']:.0f} B"
        )
    save(out, rows, threads, repeats)


@app.command()
def scaling(
    repeats: int = 9,
    threads: Annotated[str, typer.Option(help="numbers of threads, comma-separated")] = "1,2",
    out: Path = Path("results/benchmarks/scaling.json"),
):
    """Measure the fixed cost of a step, the parallel share of its phases on two threads, and steps
    on some numbers of threads.
    """
    from .scaling import by_threads, shares, sizes

    numbers = [int(n) for n in threads.split(",")]
    rows = sizes(repeats) + shares(repeats)
    for size in ("100k", "1M"):
        rows += by_threads(CELLS[size], numbers, repeats)
    for row in rows:
        typer.echo("  ".join(f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                             for key, value in row.items()))
    save(out, rows, max(numbers), repeats)


@app.command()
def printed(
    scenes: Annotated[str, typer.Argument(help="scene files, or names such as faceless, at the "
                                          "size that the paper prints, comma-separated")],
    threads: Annotated[str, typer.Option(help="numbers of threads, comma-separated")] = "2",
    seconds: Annotated[float, typer.Option(help="wall time of the first of them")] = 600.0,
    method: str = "hot",
    out: Path = Path("results/benchmarks/printed.json"),
):
    """Measure the first implicit steps of HOT's scenes at the printed size, and their memory."""
    from .printed import costs

    numbers = [int(n) for n in threads.split(",")]
    rows = costs(scenes.split(","), numbers, seconds, method)
    for row in rows:
        typer.echo("  ".join(f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                             for key, value in row.items()))
    save(out, rows, max(numbers), 1)


@app.command()
def hot(
    steps: Annotated[str, typer.Option(help="of twist, box, comma-separated")] = "twist,box",
    threads: int = 1,
    repeats: int = 7,
    out: Path = Path("results/benchmarks/hot.json"),
):
    """Measure the CPU time of an implicit step, of each of its parts, and of pyamg."""
    from mpm_ref.core.jit import set_threads

    from .hot import costs

    set_threads(threads)
    with threadpoolctl.threadpool_limits(threads):
        rows = costs(steps.split(","), repeats)
    for row in rows:
        typer.echo(hot_line(row))
    save(out, rows, threads, repeats)


def hot_line(row):
    """Return a row of the table of implicit steps as text."""
    size = f"{row['step']:5} {row['particles']:6} particles {row['nodes']:6} nodes  "
    if "part" in row:
        return size + f"{row['part']:36} {row['cpu_ns']:9.1f} ns per {row['per']}"
    name = row["method"] if "method" in row else "CG with " + row["solver"]
    spent = " ".join(f"{part} {1e3 * t:.1f}" for part, t in row.get("parts_s", {}).items())
    return size + (f"{name:36} {row['cpu_s']:9.4f} s  x {row['cpu_ratio']:.2f}  "
                   f"{row['iterations']} iterations" + ("  ms: " + spent if spent else ""))


@app.command()
def implicit_features(
    steps: Annotated[int, typer.Option(help="of a block that hits a floor")] = 12,
    threads: int = 1,
    repeats: int = 5,
    out: Path = Path("results/benchmarks/implicit_features.json"),
):
    """Measure the CPU time of implicit steps with each feature, from friction to a source."""
    from mpm_ref.core.jit import set_threads

    from .implicit_features import implicit_rows

    set_threads(threads)
    with threadpoolctl.threadpool_limits(threads):
        rows = implicit_rows(steps, repeats)
    for row in rows:
        typer.echo(f"{row['variant']:52} {row['cpu_s']:8.4f} s  x {row['cpu_ratio']:.2f}  "
                   f"{row['iterations']:.1f} iterations"
                   + ("" if row["converged"] else ", not all solved"))
    save(out, rows, threads, repeats)


@app.command()
def hot_runs(
    runs: Annotated[str, typer.Option(help="of hot_runs.RUNS, comma-separated; none: all")] = "",
    threads: int = 1,
    out: Path = Path("results/benchmarks/hot_runs.json"),
):
    """Measure the CPU time of implicit steps of whole runs by our variants."""
    from mpm_ref.core.jit import set_threads

    from .hot_runs import RUNS, run_rows

    set_threads(threads)
    rows = []
    with threadpoolctl.threadpool_limits(threads):
        for name in runs.split(",") if runs else RUNS:
            new = run_rows(name)
            rows += new
            for row in new:
                typer.echo(run_line(row))
    save(out, rows, threads, 1)


def run_line(row):
    """Return a row of the table of runs as text."""
    public = "" if row["public_cpu_s"] is None else (
        f"  x {row['cpu_s'] / row['public_cpu_s']:.2f} of the public code")
    return (f"{row['run']:12} {row['particles']:6} particles {row['nodes']:6} nodes  "
            f"{row['variant']:20} {row['cpu_s']:7.3f} s a step, most {row['most_cpu_s']:.3f}  "
            f"x {row['cpu_ratio']:.2f}  iterations {row['iterations']:.1f}, most "
            f"{row['most_iterations']}{public}")


@app.command()
def workers(out: Path = Path("results/benchmarks/workers.json")):
    """Simulate many workers of a dask scheduler, from times that are measured here."""
    from .many_workers import worker_rows

    rows = worker_rows()
    for row in rows:
        typer.echo(f"{row['workload']:30} {row['workers']:5} workers  wall {row['wall_s']:9.1f} s  "
                   f"efficiency {row['efficiency']:.3f}")
    save(out, rows, 1, 1)


@app.command()
def cluster(out: Path = Path("results/benchmarks/cluster.json")):
    """Time a sweep on 1, 2, 4, ... workers up to the number of cores, and compare the results."""
    from .cluster import measured_rows

    rows = measured_rows()
    for row in rows:
        typer.echo(f"{row['executor']:10} {row['workers']:3} workers  wall {row['wall_s']:7.2f} s  "
                   f"x {row['speed_up']:.2f}  same bits: {row['same_bits']}")
    save(out, rows, 1, 1)


@app.command()
def start(name: str, size: str = "100k", threads: int = 2):
    """Print the seconds to the end of the first step and the peak memory per particle as JSON.

    One backend is measured, in this process.
    """
    began = time.perf_counter()
    problem = block(CELLS[size])
    initial = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    stepper = make_backend(name, problem, threads)
    stepper.step(1)
    seconds = time.perf_counter() - began
    stepper.step(WARM_UP)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - initial
    typer.echo(json.dumps({
        "backend": name, "size": size, "first_step_s": round(seconds, 2),
        "peak_bytes_per_particle": round(grown * 1024 / len(problem.x)),
    }))


@app.command()
def starts(
    backends: Annotated[str, typer.Option()] = "mpm_ref,taichi,warp",
    size: str = "100k",
    threads: int = 2,
    out: Annotated[Path, typer.Option()] = Path("results/benchmarks/start.json"),
):
    """Run `start` for every backend in separate processes, with empty caches, then full ones."""
    rows = []
    for name in backends.split(","):
        with tempfile.TemporaryDirectory() as caches:
            rows += [
                {"cache": cache} | run_process(["start", name, "--size", size], threads, caches)
                for cache in ("cold", "warm")
            ]
    for row in rows:
        typer.echo(json.dumps(row))
    save(out, rows, threads, 1)


def run_process(command, threads, caches):
    """Return what a command of this module prints last, and the seconds of its process.

    command: list of arguments; caches: folder of the kernel caches.
    """
    places = ("NUMBA_CACHE_DIR", "TI_OFFLINE_CACHE_FILE_PATH", "WARP_CACHE_PATH")
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks", *command, "--threads", str(threads)],
        env=os.environ | dict.fromkeys(places, caches), capture_output=True, text=True, check=True,
    )
    seconds = time.perf_counter() - began
    return json.loads(done.stdout.splitlines()[-1]) | {"process_s": round(seconds, 2)}


if __name__ == "__main__":
    app()
