"""Pages that are made from the repository whenever the site is built; git ignores them.

`reference/api` from the modules, `reference/cli.md` from the command line, `reference/equations.md`
from the citations in code and tests, `reference/packages` and `contributing.md` from the READMEs of
packages and CONTRIBUTING, `results/generated`, `results/numbers` and `results/paper-figures` from
the records of experiments, and `tutorials` from the notebooks.
"""

import ast
import re
from pathlib import Path

import typer.cli
import typer.main

from validation.common import equations
from validation.common.citations import ROOT

from . import packages, results
from .markdown import cell

DOCS = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mpm_ref"
FOLDERS = ("reference/api", "reference/packages", "results/generated", "results/numbers",
           "results/paper-figures")


def write_all(app, config):
    """Write all generated pages, each only if its text has changed."""
    pages = {**api_pages(), **packages.pages(), **results.pages(), **notebooks(),
             "reference/cli.md": cli_page(),
             "reference/equations.md": equations.render(equations.read(), equations.scan())}
    for name, text in pages.items():
        write(DOCS / name, text)
    kept = {DOCS / name for name in pages}
    for folder in FOLDERS:
        for file in (DOCS / folder).rglob("*.*"):
            if file not in kept:
                file.unlink()


def write(path, text):
    """Write a page, or a figure in bytes, if it is new: an unchanged one is not read again."""
    content = text if isinstance(text, bytes) else text.encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_bytes() != content:
        path.write_bytes(content)


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


# --- the command line

def cli_page():
    """Every command with its arguments and options."""
    from mpm_ref.cli import app
    command = typer.main.get_command(app)
    show_whole_summaries(command)
    context = typer.Context(command, info_name="mpm-ref")
    return typer.cli.get_docs_for_click(obj=command, ctx=context, name="mpm-ref",
                                        title="Command line")


def show_whole_summaries(command):
    """Let lists of commands show the whole first sentence of each; by default they cut it."""
    command.short_help = re.split(r"\.\s|\n\s*\n|\f", (command.help or "") + "\n\n")[0]
    for child in getattr(command, "commands", {}).values():
        show_whole_summaries(child)


# --- tutorials

def notebooks():
    """{path: text} of the tutorials."""
    return {f"tutorials/{file.name}": file.read_text(encoding="utf-8")
            for file in sorted((ROOT / "notebooks").glob("*.ipynb"))}


def setup(app):
    """Write the pages before Sphinx looks for them."""
    app.connect("config-inited", write_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
