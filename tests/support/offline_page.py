"""A page taken apart: its facts, and whether it loads or builds anything from texts."""

import json
import re
from html.parser import HTMLParser

HOSTILE = "</script><img src=x onerror=alert(1)>"
LOADING = re.compile(r"https?://(?!www\.w3\.org/2000/svg)|\b(src|href|action)\s*=|@import|url\(|"
                     r"\b(fetch|import|XMLHttpRequest|WebSocket)\b\s*\(")
BUILDING = re.compile(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|Function\(")


class PageReader(HTMLParser):
    """The elements of a page with their attributes, and the texts of its scripts."""

    def __init__(self):
        super().__init__()
        self.elements, self.scripts, self.depth = [], [], 0

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append("")
            self.depth += 1

    def handle_endtag(self, tag):
        self.depth -= tag == "script"

    def handle_data(self, data):
        if self.depth:
            self.scripts[-1] += data


def read(page):
    """The `PageReader` of a page."""
    reader = PageReader()
    reader.feed(page)
    return reader


def facts_of(page):
    """The facts that a page holds."""
    return json.loads(read(page).scripts[0])


def assert_holds(page, facts):
    """The page holds the facts, loads nothing, and no text of them is markup."""
    reader = read(page)
    scripts = [attrs for tag, attrs in reader.elements if tag == "script"]
    assert scripts == [{"type": "application/json", "id": "facts"}, {}, {}]
    assert reader.depth == 0
    assert json.loads(reader.scripts[0]) == facts
    rest = page.replace(reader.scripts[0], "")
    assert not LOADING.search(rest)
    assert not BUILDING.search(rest)
    names = {tag for tag, _ in reader.elements}
    assert not names & {"img", "link", "iframe", "object", "embed", "base", "audio", "video"}
    assert not [key for _, attrs in reader.elements for key in attrs if key.startswith("on")]
    assert "default-src 'none'" in page
    assert "<!--" not in page.removeprefix("<!DOCTYPE html>")
