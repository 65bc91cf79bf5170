"""Second implementations of parts of the package, and their agreement with it.

They were written from the papers and the documentation, before the package's code was read.
"""
