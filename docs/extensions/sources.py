"""Source files as pages, and the role that links to a file or to a definition in it.

`{source}` takes `path` or `path::name`, as citations in the equation index are written. A link that
leads nowhere is a warning, and so an error of the build. Of the package all files have a page, of
tests, experiments and scenes those that some page links to.
"""

import ast
import html
import re
import shutil
from functools import cache
from pathlib import Path

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import get_lexer_for_filename
from sphinx.util import logging
from sphinx.util.docutils import ReferenceRole

from validation.common.citations import ROOT, definitions

FOLDER = "source"
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{path}</title><link rel="stylesheet" href="{up}_static/source.css"></head>
<body><header><a href="{up}index.html">mpm_ref</a> <code>{path}</code>{api}</header>
{code}</body></html>
"""
LINK = re.compile(rf'href="(?:\.\./)*{FOLDER}/([^"#]+)\.html')
logger = logging.getLogger(__name__)


class SourceRole(ReferenceRole):
    """A link to a source file, or to a function or class in it."""

    def run(self):
        """Return the link; warn where there is no such file or name."""
        file, _, name = self.target.partition("::")
        line = line_of(file, name)
        if line is None:
            logger.warning("no such source: %s", self.target, location=self.get_location(),
                           type="source")
            return [nodes.literal(self.rawtext, self.title)], []
        self.env.note_dependency(ROOT / file)
        up = "../" * self.env.docname.count("/")
        literal = nodes.literal("", self.title)
        return [nodes.reference(self.rawtext, "", literal, internal=True,
                                refuri=up + address(file, line))], []


def address(file, line=1):
    """Address of a line of a source page, from the top of the site."""
    return f"{FOLDER}/{file}.html" + (f"#L-{line}" if line > 1 else "")


def line_of(file, name=""):
    """First line of a definition, `function` or `Class::method`; None where there is none."""
    if not (ROOT / file).is_file():
        return None
    return spans(file).get(name) if name else 1


@cache
def spans(file):
    """{name: first line} of the definitions of a file."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {name: first for first, _, name in definitions(tree)}


def linked(outdir):
    """Files that some page of the site links to."""
    pages = (page for page in Path(outdir).rglob("*.html")
             if FOLDER not in page.relative_to(outdir).parts)
    return {match[1] for page in pages for match in LINK.finditer(page.read_text("utf-8"))}


def write_pages(app, exception):
    """Write the pages of all sources once the site is built."""
    if exception or app.builder.format != "html":
        return
    remove_old(app)
    package = {p.relative_to(ROOT).as_posix() for p in (ROOT / "mpm_ref").rglob("*.py")}
    for file in sorted(package | linked(app.outdir)):
        target = Path(app.outdir, FOLDER, f"{file}.html")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(page(file), encoding="utf-8")


def remove_old(app):
    """Remove pages of an earlier build whose documents or sources are gone."""
    outdir = Path(app.outdir)
    shutil.rmtree(outdir / FOLDER, ignore_errors=True)
    for page in outdir.glob("*/**/*.html"):
        name = page.relative_to(outdir).with_suffix("").as_posix()
        if not name.startswith("_") and name not in app.env.all_docs:
            page.unlink()


def page(file):
    """A source file as a page, with a target for each line."""
    lexer = get_lexer_for_filename(file, stripnl=False)
    formatter = HtmlFormatter(linenos="inline", lineanchors="L", anchorlinenos=True)
    up = "../" * (file.count("/") + 1)
    return PAGE.format(path=html.escape(file), up=up, api=api_link(file, up),
                       code=highlight((ROOT / file).read_text(encoding="utf-8"), lexer, formatter))


def api_link(file, up):
    """Return the link from a module's source to its page of the interface; "" for other files."""
    if not file.startswith("mpm_ref/") or file.endswith("__main__.py"):
        return ""
    module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    return f' <a href="{up}reference/api/{module}.html">documentation</a>'


def linkcode_resolve(domain, info):
    """Address of the source of an object, from a page of `reference/api`."""
    file = info["module"].replace(".", "/")
    path = f"{file}.py" if (ROOT / f"{file}.py").is_file() else f"{file}/__init__.py"
    line = line_of(path, info["fullname"].replace(".", "::"))
    return f"../../{address(path, line)}" if line else None


def setup(app):
    """Register the role, and the pages."""
    app.add_role("source", SourceRole())
    app.connect("build-finished", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
