"""Help texts: what a terminal shows and what the site's page shows are what was meant."""

import sys
from html import unescape

import pytest
import typer
from markdown_it import MarkdownIt
from rich.text import Text

from mpm_ref.cli import app
from validation.common.citations import ROOT

sys.path.insert(0, str(ROOT / "docs"))

from extensions import generate


def commands(command, name="mpm-ref"):
    """Yield (name, command) of a command and of those below it."""
    yield name, command
    for child, below in getattr(command, "commands", {}).items():
        yield from commands(below, f"{name} {child}")


HELPS = [(f"{name} {one.opts[0]}", one.help) for name, command in
         commands(typer.main.get_command(app)) for one in command.params
         if getattr(one, "help", None)]


@pytest.mark.parametrize(("name", "text"), HELPS)
def test_a_terminal_and_the_site_show_the_same_words(name, text):
    site = unescape(MarkdownIt().renderInline(text.replace("`", "")))
    assert Text.from_markup(text).plain.replace("`", "") == site
    assert "\\" not in site


@pytest.mark.parametrize("command", ["trade", "limits", "needs"])
def test_tables_of_a_scene_keep_their_brackets(command):
    options = dict(HELPS)[f"mpm-ref {command} --quantity"]
    assert "the [[quantity]] tables" in Text.from_markup(options).plain
    line, = {line for line in generate.cli_page().splitlines() if "--quantity" in line}
    assert "the [[quantity]] tables" in MarkdownIt().render(line)
