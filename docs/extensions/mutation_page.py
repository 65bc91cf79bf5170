"""The table of mutations: which checks of each experiment fail once its subject is broken."""

from validation.mutations import listing, table

from .markdown import cell, grid_table

FILE = "results/generated/mutations.md"
SHOWN = 3           # checks that no mutation breaks, of an experiment


def pages():
    """Return {path: text} of the table, from `results/mutations.csv`."""
    rows = table.read()
    return {FILE: "\n".join(lines(listing.load(), [rows[id] for id in sorted(rows)]))}


def lines(mutations, rows):
    """Yield the counts, the rows of experiments with checks, and what each mutation breaks."""
    judged = [row for row in rows if row.checks]
    yield (f"{sum(row.broken for row in judged)} of {sum(row.checks for row in judged)} checks of "
           f"{len(judged)} experiments that pass at the quick profile fail under a mutation. "
           f"{len(rows) - len(judged)} more experiments judge nothing that passes at this "
           "profile.\n")
    yield from grid_table(("experiment", "checks that fail", "mutations", "checks that no mutation "
                           "breaks"), map(cells, judged))
    yield "Mutations:\n"
    yield from (f"- *{cell(one.name)}:* {cell(one.breaks)}" for one in mutations.mutation)
    if mutations.without:
        yield "\nWithout a mutation that breaks a check:\n"
        yield from (f"- `{', '.join(one.experiments)}`: {cell(one.why)}"
                    for one in mutations.without)


def cells(row):
    """Return the cells of an experiment."""
    unbroken = row.unbroken.split("; ") if row.unbroken else []
    more = f" and {len(unbroken) - SHOWN} more" if len(unbroken) > SHOWN else ""
    return [f"`{row.experiment}`", f"{row.broken} of {row.checks}", cell(row.mutations or "none"),
            cell(", ".join(unbroken[:SHOWN]) + more)]
