"""Pieces of Markdown for generated pages."""


def cell(text):
    """Return a text for a cell of a table, with nothing read as markup."""
    text = text.replace("\\", "\\\\").replace("|", "\\|").replace("\n", " ")
    return "".join(f"\\{c}" if c in "*_<>[]{}$" else c for c in text.replace("`", ""))


def grid_table(header, rows):
    """Return the lines of a table, from cells that are Markdown already."""
    return ["| " + " | ".join(header) + " |", "|" + "---|" * len(header),
            *("| " + " | ".join(row) + " |" for row in rows), ""]
