"""Pages that are made from the repository whenever the site is built; git ignores them.

`reference/api` from the modules, `reference/cli.md` from the command line, `reference/equations.md`
from the citations in code and tests, `results/generated` from the records of experiments, and
`tutorials` from the notebooks.
"""

import ast
from pathlib import Path

import typer.cli
import typer.main

from validation.common import equations, targets
from validation.common.citations import ROOT
from validation.common.report import chapters, status_table
from validation.common.results import RESULTS, ProfileResults

DOCS = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mpm_ref"
PAPERS = ("hot", "ldm", "ldmw", "nclaw", "nsf")
COLUMNS = ("what", "printed; accepted", "measured", "verdict", "scale")


def write_all(app, config):
    """Write all generated pages, each only if its text has changed."""
    pages = {**api_pages(), **result_pages(), **notebooks(),
             "reference/cli.md": cli_page(),
             "reference/equations.md": equations.render(equations.read(), equations.scan())}
    for name, text in pages.items():
        write(DOCS / name, text)
    for stale in set((DOCS / "reference/api").glob("*")) - {DOCS / name for name in pages}:
        stale.unlink()


def write(path, text):
    """Write a page if its text is new, so that an unchanged page is not read again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


# --- the Python interface

def api_pages():
    """{path: text}: a page for each module, and one that lists the packages."""
    modules = {dotted(file): file for file in sorted(PACKAGE.rglob("*.py"))
               if file.name != "__main__.py"}
    pages = {f"reference/api/{name}.rst": module_page(name, modules) for name in modules}
    return {**pages, "reference/api/index.md": api_index(modules)}


def dotted(file):
    """Dotted name of a module's file."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


def summary(file):
    """First sentence of a module's docstring, on one line."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def module_page(name, modules):
    """The page of one module; that of a package leads to its modules."""
    parts = [name, "=" * len(name), "", f".. automodule:: {name}", "   :members:", ""]
    children = [m for m in modules if m.rpartition(".")[0] == name]
    if children:
        parts += [".. toctree::", "   :maxdepth: 1", "   :caption: Modules", "",
                  *(f"   {m}" for m in children), ""]
    return "\n".join(parts)


def api_index(modules):
    """The list of all modules by package, each with the first sentence of its docstring."""
    packages = [m for m, file in modules.items() if file.name == "__init__.py"]
    parts = ["# Python interface", "",
             "One page for each module. A signature is followed by `[source]`, a link to the code.",
             "", "```{toctree}", ":hidden:", "", "mpm_ref", "```", ""]
    for package in packages:
        rows = [m for m in modules if m.rpartition(".")[0] == package and m not in packages]
        parts += [f"## {package}", "", summary(modules[package]).replace("`", ""), "",
                  "| module | about |", "|---|---|",
                  *(f"| [{m.removeprefix(package + '.')}]({m}.rst) | {cell(summary(modules[m]))} |"
                    for m in rows), ""]
    return "\n".join(parts)


def cell(text):
    """Text that may stand in a cell of a Markdown table, with nothing read as markup."""
    text = text.replace("\\", "\\\\").replace("|", "\\|").replace("\n", " ")
    return "".join(f"\\{c}" if c in "*_<>[]{}$" else c for c in text.replace("`", ""))


# --- the command line

def cli_page():
    """Every command with its arguments and options."""
    from mpm_ref.cli import app
    command = typer.main.get_command(app)
    context = typer.Context(command, info_name="mpm-ref")
    text = typer.cli.get_docs_for_click(obj=command, ctx=context, name="mpm-ref",
                                        title="Command line")
    return text


# --- results

def result_pages():
    """{path: text}: a page of numbers for each paper, and the list of all experiments."""
    printed = targets.load()
    made = {profile: {c.key: c for c in chapters(ProfileResults(RESULTS / profile), printed)}
            for profile in ("standard", "paper")}
    pages = {f"results/generated/{key}.md": numbers(key, made) for key in PAPERS}
    table = status_table(ProfileResults(RESULTS / "standard"), printed)
    return {**pages, "results/generated/experiments.md": table + "\n"}


def numbers(key, made):
    """Printed numbers beside ours, experiment by experiment, with the notes of those missed."""
    parts = []
    for profile, groups in made.items():
        for section in groups[key].sections:
            rows = [row for row in section.rows if row.paper != "—"]
            if rows:
                parts += [f"### {section.id} ({profile})", "", *map(cell, section.remarks), "",
                          *table(rows), "", *notes(rows), ""]
    missing = made["standard"][key].missing
    if missing:
        parts += ["### Not measured", "", *(f"- {cell(t.what)} ({cell(t.paper_ref)})"
                                            for t in missing), ""]
    return "\n".join(parts)


def table(rows):
    """A Markdown table of records; a scale that all share stands before it."""
    scales = {row.scale for row in rows}
    columns = COLUMNS if len(scales) > 1 else COLUMNS[:-1]
    if len(scales) == 1:
        yield from (f"Scale: {cell(scales.pop())}.", "")
    yield "| " + " | ".join(columns) + " |"
    yield "|" + "---|" * len(columns)
    for row in rows:
        printed = f"{row.paper}; {row.rule}" if row.rule else row.paper
        values = (row.what, printed, row.ours, row.verdict, row.scale)
        yield "| " + " | ".join(cell(text) for text in values[:len(columns)]) + " |"


def notes(rows):
    """The notes of missed numbers, each text once."""
    missed = {row.note: row.what for row in reversed(rows) if row.verdict == "miss" and row.note}
    return [f"- *Missed:* {cell(what)}: {cell(note)}" for note, what in reversed(missed.items())]


# --- tutorials

def notebooks():
    """{path: text} of the tutorials."""
    return {f"tutorials/{file.name}": file.read_text(encoding="utf-8")
            for file in sorted((ROOT / "notebooks").glob("*.ipynb"))}


def setup(app):
    """Write the pages before Sphinx looks for them."""
    app.connect("config-inited", write_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
