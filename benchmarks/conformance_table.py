"""Tables of a record of `benchmarks.conformance` in Markdown: its stages, gradients and departures.

A number is the largest difference of a stage over its tolerance, over all cases, steps and arrays:
what is more than 1 departs, and stands in bold type.
"""

from mpm_ref.oracle.schema import ADJOINT, ARRAYS

BACKENDS = {"taichi": "Taichi", "warp": "Warp"}
PRECISIONS = ("f64", "f32")
COLUMNS = tuple((name, precision) for name in BACKENDS for precision in PRECISIONS)


def stage_table(rows):
    """Return the lines of the table of stages, of steps with the library's decomposition."""
    heads = [f"{BACKENDS[name]} {precision}" for name, precision in COLUMNS]
    columns = [[row for row in rows if row["kind"] == "steps" and not row["replaced"]
                and (row["backend"], row["precision"]) == column] for column in COLUMNS]
    return table_lines(heads, columns, ARRAYS)


def adjoint_table(rows):
    """Return the lines of the table of stages backwards, by Warp's tape."""
    columns = {}
    for svds, title in ((("newton", "none"), "by Newton's iteration"),
                        (("library",), "by `wp.svd3`")):
        for precision in PRECISIONS:
            columns[f"{precision}, rotations {title}"] = [
                row for row in rows if row["kind"] == "adjoint" and row["svd"] in svds
                and row["precision"] == precision]
    return table_lines(list(columns), list(columns.values()), ADJOINT)


def table_lines(heads, columns, arrays):
    """Return the lines of a table with a row for each stage of `arrays` and a list of rows of the
    record for each column.
    """
    lines = [f"| stage | {' | '.join(heads)} |", "|---|" + "---|" * len(heads)]
    for stage in dict.fromkeys(array.stage for array in arrays):
        cells = [cell(stage, column) for column in columns]
        if any(cells):
            lines.append(f"| {stage} | {' | '.join(cells)} |")
    return lines


def cell(stage, rows):
    """Return the largest error of a stage in rows, with the case; "" where none has the stage."""
    entries = [(size(row["stages"][stage]["units"]), row["case"], row["stages"][stage]["what"])
               for row in rows if stage in row["stages"]]
    if not entries:
        return ""
    units, case, what = max(entries)
    text = what or f"{units:.2g}"
    return f"**{text}**, {case}" if units > 1.0 else f"{text}, {case}"


def size(units):
    """Return a number of the record, infinite where there is none."""
    return float("inf") if units is None else units


def departure_lines(rows):
    """Return the lines of a table of the checks that depart: where first, by how much, the error of
    the rotations, and the largest difference once the decomposition is replaced.
    """
    lines = ["| case | backend | departs first at | difference | over tolerance | error of "
             "rotations: largest, median | after replacement |", "|---|---|---|---|---|---|---|"]
    lines += [departure_line(row, row["first"], replacement(rows, row)) for row in rows
              if row["first"] is not None and not row["replaced"]]
    return lines


def replacement(rows, row):
    """Return the last row of the same check in which more is replaced: the decomposition, then the
    light nodes; backwards the rotation, by Newton's iteration. None where there is none.
    """
    names = ("kind", "case", "backend", "precision")
    others = [other for other in rows if len(other["replaced"]) > len(row["replaced"])
              and all(other[name] == row[name] for name in names)]
    return others[-1] if others else None


def departure_line(row, first, other):
    """Return the line of a check whose first departure is `first`, with that of its replacement."""
    place = f"step {first['step']}, {first['array']}, {first['where'] or first['what']}"
    numbers = ["", ""]
    if first["difference"] is not None:
        over = first["difference"] / first["tolerance"] if first["tolerance"] else float("inf")
        numbers = [f"{first['difference']:.1e}", f"{over:.2g}"]
    R = row.get("rotations")
    rotations = "" if R is None else (
        f"{R['largest']:.1e} (step {R['step']}, particle {R['particle']}), {R['median']:.1e}")
    backend = f"{BACKENDS[row['backend']]} {row['precision']}"
    backend += " adjoint" if row["kind"] == "adjoint" else ""
    after = "" if other is None else f"{worst(other):.2g} ({' and '.join(other['replaced'])})"
    return (f"| {row['case']} | {backend} | {place} | {numbers[0]} | {numbers[1]} | {rotations} "
            f"| {after} |")


def worst(row):
    """Return the largest difference of a row in units of its tolerance."""
    return max((size(entry["units"]) for entry in row["stages"].values()), default=0.0)


def report_line(row):
    """Return a row of the record as a line of text."""
    state = "agrees" if row["agrees"] else f"departs in {row['departures']} of {row['arrays']}"
    first = "" if row["first"] is None else (
        f", first at {row['first']['stage']}, {row['first']['array']}")
    replaced = f" ({' and '.join(row['replaced'])} replaced)" if row["replaced"] else ""
    return (f"{row['kind']:8}{row['case']:22} {row['backend']:7}{row['precision']}{replaced} "
            f"{state}{first}; largest difference {worst(row):.2g} of its "
            "tolerance")
