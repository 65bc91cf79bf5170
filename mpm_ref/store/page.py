"""Put the facts of an answer into a page that opens offline.

The template of a command stands beside its code; what all pages share, `shared.html`, stands here
and not in `sweep`, whose source names the stored runs.
"""

import json
from importlib.resources import files

PACKAGE = __package__.partition(".")[0]
SHARED, FACTS = "<!--shared-->", "<!--facts-->"      # places in a template and in what is shared


def page_of(facts, command):
    """Return the HTML text of the page of a command, which its package of that name holds.

    facts: plain finite data. They stand in the page as JSON; no text in them can end the element
    that holds it. Raises ValueError for a number that is not finite.
    """
    text = json.dumps(facts, allow_nan=False).replace("<", "\\u003c")
    shared = text_of("store", "shared.html").rstrip("\n")
    return text_of(command, "page.html").replace(SHARED, shared).replace(FACTS, text)


def text_of(folder, name):
    """Return the text of a file of the package."""
    return files(PACKAGE).joinpath(folder, name).read_text(encoding="utf-8")
