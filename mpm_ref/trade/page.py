"""Write the answer of a search as a page that opens offline: front, filters, and a slider."""

import json
from importlib.resources import files
from string import Template

TEMPLATE = "page.html"


def page_of(facts):
    """Return the HTML text of a page with the facts of `answer.answer_of`, as plain finite data.

    The facts stand in the page as JSON; no text of a scene can end the element that holds it.
    """
    template = files(__package__).joinpath(TEMPLATE).read_text(encoding="utf-8")
    text = json.dumps(facts, allow_nan=False).replace("<", "\\u003c")
    return Template(template).substitute(facts=text)
