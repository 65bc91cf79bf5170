"""Names in pages become links: ids of equations (HOT-eq1), and of experiments in backticks."""

from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform

from validation.common.citations import ID

from .docstrings import equation_ids
from .results import experiment_places

INDEX = "reference/equations"
KEPT = (nodes.literal, nodes.literal_block, nodes.reference, nodes.title, nodes.raw, nodes.math,
        nodes.math_block)


class CrossLinks(SphinxPostTransform):
    """Link the names in running text and tables, outside of titles, code and other links."""

    default_priority = 900

    def run(self, **options):
        """Link the names in one document."""
        if self.app.builder.format != "html":
            return
        up = "../" * self.env.docname.count("/")
        if self.env.docname != INDEX:
            self.link_equations(f"{up}{INDEX}.html#")
        self.link_experiments(up)

    def link_equations(self, address):
        """Link the ids of equations."""
        for text in list(self.document.findall(nodes.Text)):
            if ID.search(text) and not inside(text, KEPT):
                text.parent.replace(text, linked(text, address))

    def link_experiments(self, up):
        """Link the ids of experiments to their numbers."""
        for literal in list(self.document.findall(nodes.literal)):
            place = experiment_places().get(literal.astext())
            if place and not inside(literal, KEPT):
                page, name = place
                address = f"{up}{page}.html#{nodes.make_id(name)}"
                link = nodes.reference("", "", literal.deepcopy(), internal=True, refuri=address)
                literal.parent.replace(literal, link)


def inside(node, kinds):
    """Return whether a node has an ancestor of one of the kinds."""
    while node := node.parent:
        if isinstance(node, kinds):
            return True
    return False


def linked(text, address):
    """Return the nodes of a text, with a link for each id of the index."""
    parts, end = [], 0
    for match in ID.finditer(text):
        if match[0] in equation_ids():
            parts += [nodes.Text(text[end:match.start()]),
                      nodes.reference("", match[0], internal=True, refuri=address + match[0])]
            end = match.end()
    return [*parts, nodes.Text(text[end:])]


def setup(app):
    """Register the transform."""
    app.add_post_transform(CrossLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
