"""Docstrings are Markdown; Sphinx reads reStructuredText: translate, and list fields of records.

Of Markdown the docstrings use paragraphs, lists, `code` and indented blocks. Asterisks and
underscores are those of formulas, not emphasis. A paragraph whose lines are formulas, or are
aligned by spaces, keeps its lines.
"""

import ast
import inspect
import io
import re
import textwrap
import tokenize
from functools import cache

from markdown_it import MarkdownIt

from validation.common import equations
from validation.common.citations import ID as IDS

MARKDOWN = MarkdownIt("zero").enable(["code", "fence", "list", "backticks"])
FORMULA = re.compile(r"^[A-Za-z]\S*(?: \S+){0,2} (?:[-+*/]?=|->) \S", re.MULTILINE)
ALIGNED = re.compile(r"^ *\S.* {3,}\S|\n {2,}\S", re.MULTILINE)
SPECIAL = re.compile(r"([\\*_`|<>])")


def to_rest(text):
    """Return reStructuredText of a docstring."""
    paragraphs = re.split(r"\n(?:[ ]*\n)+", text.strip("\n"))
    marked = "\n\n".join(textwrap.indent(p, "    ") if keeps_lines(p) else p for p in paragraphs)
    return "\n".join(blocks(MARKDOWN.parse(marked)))


def keeps_lines(paragraph):
    """Whether the lines of a paragraph are formulas or columns, not running text."""
    lines = paragraph.splitlines()
    if len(lines) < 2 or paragraph.startswith((" ", "-", "*", "1")):
        return False
    return len(FORMULA.findall(paragraph)) * 2 > len(lines) or bool(ALIGNED.search(paragraph))


def blocks(tokens):
    """Lines of reStructuredText of Markdown's block tokens."""
    lines, markers = [], []
    for token in tokens:
        indent = "   " * len(markers)
        if token.type == "list_item_open":
            markers.append(f"{token.info}. " if token.info else "-  ")
        elif token.type == "list_item_close":
            markers.pop()
        elif token.type == "inline":
            lines += item(inline(token), markers)
        elif token.type in ("code_block", "fence"):
            code = re.sub(" {4,}#", "   #", token.content)        # citations at the end of a line
            lines += [f"{indent}::", "", textwrap.indent(code, indent + "   "), ""]
    return lines


def item(text, markers):
    """Lines of a paragraph; the first of a list item begins with its marker."""
    if not markers:
        return [text, ""]
    indent = "   " * (len(markers) - 1)
    first, *rest = text.splitlines()
    marker, markers[-1] = markers[-1], "   "
    return [f"{indent}{marker:<3}{first}", *(f"{indent}   {line}" for line in rest), ""]


def inline(token):
    """Text of a paragraph, with all that reStructuredText would read as markup escaped."""
    return "".join(map(piece, token.children))


def piece(part):
    """One piece of a paragraph: code, the end of a line, or text."""
    if part.type == "softbreak":
        return "\n"
    if part.type == "code_inline" and part.content.strip():
        return f"\\ ``{part.content}``\\ "
    return IDS.sub(link, SPECIAL.sub(r"\\\1", part.content))


def link(match):
    """An id of the equation index as a link to it, from a page of `reference/api`."""
    if match[0] not in equation_ids():
        return match[0]
    return f"\\ `{match[0]} <../equations.html#{match[0]}>`__\\ "


@cache
def equation_ids():
    """The ids of the equation index."""
    return set(equations.read().entries)


def fields(cls):
    """[(name, type, comment)] of the annotated fields of a class, in the order of its source."""
    try:
        source = textwrap.dedent(inspect.getsource(cls))
        body = ast.parse(source).body[0].body
    except (OSError, TypeError, SyntaxError, IndexError):
        return []
    comments = {token.start[0]: token.string.lstrip("# ").strip()
                for token in tokenize.generate_tokens(io.StringIO(source).readline)
                if token.type == tokenize.COMMENT}
    return [(node.target.id, ast.unparse(node.annotation), comments.get(node.end_lineno, ""))
            for node in body
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
            and not node.target.id.startswith("_")]


def field_list(cls):
    """Markdown list of the fields of a class."""
    rows = fields(cls)
    lines = [f"- `{name}`" + (f": {comment}" if comment else f" (`{kind}`)")
             for name, kind, comment in rows]
    return "\n\nFields:\n\n" + "\n".join(lines) if rows else ""


def translate(app, what, name, thing, options, lines):
    """Replace the lines of a docstring; a class gets the list of its fields."""
    text = "\n".join(lines)
    if what == "class":
        text += field_list(thing)
    lines[:] = to_rest(text).splitlines()


def skip_member(app, what, name, thing, skip, options):
    """Leave out names of other packages, and fields of records, which are listed apart."""
    foreign = not (getattr(thing, "__module__", None) or "mpm_ref").startswith("mpm_ref")
    if foreign or type(thing).__name__ in ("_tuplegetter", "member_descriptor"):
        return True
    return None


def setup(app):
    """Translate docstrings before autodoc shows them."""
    app.connect("autodoc-process-docstring", translate)
    app.connect("autodoc-skip-member", skip_member)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
