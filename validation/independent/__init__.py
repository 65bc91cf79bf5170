"""Second implementations, written from the papers and the documentation before the code was read, and
their agreement with the package.
"""
