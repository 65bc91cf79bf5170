"""Tables of the guides on reduced models and learned laws: which method is cheapest, or nearest."""

from collections import defaultdict
from math import inf, isfinite
from statistics import geometric_mean, mean

from validation.common import targets
from validation.nclaw.printed_ids import error_id

from .markdown import grid_table
from .settings import TIE, number, records

RUNS = 10, 100, 1000
ALLOWED = 0.005, 0.01, 0.02, 0.05, 0.1      # errors of the displacement, relative
TRANSFERS = {"apic": "", "mls": ", MLS-MPM"}
REDUCED = {
    "nearest": "nearest training run", "linear": "linear in the parameters",
    "interpolated": "interpolation of training runs", "curved": "LDM, curved map",
    "pod.all": "LDM, all samples", "pod.few": "LDM, 50 samples",
    "nsf.all": "NSF, all samples", "nsf.few": "NSF, few samples",
}
LAWS = {                # that learn from motion without the form of the law
    "admissible": "`admissible`", "admissible longer": "`admissible`, longer horizons",
    "ours": "`ours`", "longer": "`ours`, longer horizons", "spline": "`spline`",
    "neural": "`neural`", "gnn": "`gnn`",
}
MATERIALS = "jelly", "sand", "plasticine", "water"
TASKS = {"reconstruction": "its own run", "time": "longer", "velocity": "other velocities",
         "geometry": "another body"}


def pages(results):
    """Return {path: text} of the tables, from the `ProfileResults` of a profile."""
    tables = {"reduced": reduced, "laws": laws, "law-ranks": law_ranks}
    return {f"results/generated/which-{name}.md": "\n".join(table(results)) + "\n"
            for name, table in tables.items()}


def reduced(results):
    """Yield the cheapest method by size, number of runs and error that is allowed."""
    sizes = defaultdict(list)
    for row in records(results, "trade.reduced", "methods"):
        sizes[row["particles"]].append(row)
    header = ["particles", "runs", *(f"{100.0 * error:g} %" for error in ALLOWED)]
    yield from grid_table(header, (
        [f"{size:.0f}", str(runs), *(cheapest_text(rows, runs, error) for error in ALLOWED)]
        for size, rows in sizes.items() for runs in RUNS))


def cheapest_text(rows, runs, error):
    """Return the methods that are cheapest for a number of runs within an error, those as cheap as
    the first, and what a run of it costs in all.
    """
    fit = sorted((row for row in rows if row["error"] <= error), key=lambda row: cost(row, runs))
    least = cost(fit[0], runs)
    names = [reduced_name(row["method"]) for row in fit if cost(row, runs) <= TIE * least]
    return f"{' or '.join(names)}: {number(least)} s"


def cost(row, runs):
    """Return the CPU time [s] of a run, with its share of training and data."""
    first = row["cpu_fit"] + row["cpu_data"] + row["cpu_pairs"]
    return first / runs + row["cpu_run"]


def reduced_name(method):
    """Return a method of `trade.reduced` in words."""
    kind, _, rest = method.partition(".")
    if kind == "full":
        return "full" + TRANSFERS[rest]
    if kind == "coarse":
        factor, _, transfer = rest.rpartition(".")
        return f"grid x {factor}{TRANSFERS[transfer]}"
    if kind == "corrected":
        return f"**grid x {rest}, corrected**"
    return f"**{REDUCED[method]}**"


def law_errors(results):
    """Return {(material, task): {method: error [m^2]}}: means of the draws, inf where one broke
    down.
    """
    found = {}
    for experiment in ("nclaw.table1", "nclaw.table2", "nclaw.longer"):
        for row in records(results, experiment, "errors"):
            draws = found.setdefault((row["environment"], row["task"]), defaultdict(dict))
            draws[row["method"]][row["draw"]] = row["error"]
    return {cell: {method: mean_of(draws) for method, draws in methods.items()}
            for cell, methods in found.items()}


def mean_of(draws):
    """Return the mean of {draw: error}, inf where a draw has no finite one."""
    return mean(draws.values()) if all(map(isfinite, draws.values())) else inf


def laws(results):
    """Yield the error of each method on each material and task; the smallest is bold."""
    table = law_errors(results)
    header = ["material", "task", *LAWS.values()]
    yield from grid_table(header, (
        [material, TASKS[task], *marked(table[material, task])]
        for material in MATERIALS for task in TASKS if (material, task) in table))


def marked(errors):
    """Return the errors of LAWS as text, the smallest in bold."""
    least = min(errors.get(method, inf) for method in LAWS)
    for method in LAWS:
        error = errors.get(method)
        text = "—" if error is None else "breaks down" if error == inf else f"{error:.1e}"
        yield f"**{text}**" if error == least < inf else text


def law_ranks(results):
    """Yield how the errors of LAWS stand to the printed ones of the paper's laws, where each of
    them was run.
    """
    table, printed = law_errors(results), printed_errors()
    common = {cell: errors for cell, errors in table.items() if errors.keys() >= LAWS.keys()}
    rows = sorted((rank(method, common, printed) for method in LAWS), key=lambda row: row[:2])
    header = ["law", "tasks", "break down", "at most the printed error in",
              "error over the printed one, geometric mean", "largest"]
    yield from grid_table(header, (
        [LAWS[method], str(count), str(broken), str(reached), *map(number, (mean, worst))]
        for broken, mean, worst, reached, count, method in rows))


def printed_errors():
    """Return {(material, task): error [m^2]} that the paper prints for its own laws."""
    printed = targets.load()
    tables = {task: "nclaw.table1" if task == "reconstruction" else "nclaw.table2"
              for task in TASKS}
    return {(material, task): printed[error_id(tables[task], "ours", material, task)].value
            for material in MATERIALS for task in TASKS}


def rank(method, table, printed):
    """Return (tasks that broke down, mean and largest ratio of errors to the printed ones, tasks
    that are not above these, tasks, method); the ratios are infinite where a task broke down.
    """
    ratios = [errors[method] / printed[cell] for cell, errors in table.items()]
    return (ratios.count(inf), geometric_mean(ratios), max(ratios),
            sum(ratio <= 1.0 for ratio in ratios), len(ratios), method)
