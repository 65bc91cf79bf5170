"""Check the built site: every internal link and anchor leads somewhere, nothing is fetched.

`python docs/check_links.py FOLDER` prints the problems; the exit status says whether there are any.
"""

import re
import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

FETCHED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}
IN_STYLE = re.compile(r"""(?:url\(|@import )['"]?((?:https?:)?//[^'")]+)""")


class Page(HTMLParser):
    """The links, the targets and the fetched addresses of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.targets, self.fetched = [], set(), []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        """Note what one element links to, names or fetches."""
        attrs = dict(attrs)
        self.targets |= {attrs[key] for key in ("id", "name") if attrs.get(key)}
        if tag == "a" and attrs.get("href"):
            self.links.append(attrs["href"])
        if tag in FETCHED and attrs.get(FETCHED[tag]) and attrs.get("rel") != "canonical":
            self.fetched.append(attrs[FETCHED[tag]])


@cache
def page(path):
    """The parsed page of a path."""
    return Page(path)


def problems(root):
    """A sentence for each dead link and each address of another host that a page fetches."""
    for path in sorted(root.rglob("*.html")):
        name = path.relative_to(root)
        for link in page(path).links:
            reason = dead(path, link)
            if reason:
                yield f"{name}: {link}: {reason}"
        for address in page(path).fetched:
            if urlsplit(address).netloc:
                yield f"{name}: fetches {address}"
    for path in sorted(root.rglob("*.css")):
        for address in IN_STYLE.findall(path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(root)}: fetches {address}"


def dead(path, link):
    """Why an internal link leads nowhere; None if it leads somewhere or to another site."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return None
    file, anchor = urldefrag(link)
    target = (path.parent / unquote(urlsplit(file).path)).resolve() if file else path
    if target.is_dir():
        target = target / "index.html"
    if not target.exists():
        return "no such file"
    if anchor and target.suffix == ".html" and unquote(anchor) not in page(target).targets:
        return "no such anchor"
    return None


def main(root):
    """Print the problems; the exit status says whether there are any."""
    found = list(problems(Path(root).resolve()))
    print(*found, sep="\n", end="\n" if found else "")
    print(f"{len(found)} problems in the links of {root}")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
