"""Extensions of Sphinx for this site: generated pages, docstrings, links to source, formulas."""
