"""Fingerprints of the results of runs of every kind, to the bit. They show that a change of the
code, such as a renaming, changes no result.

    python -m validation fingerprint record FILE        # before
    python -m validation fingerprint check FILE         # after: names each case that differs

`command.cases` lists the runs, and only the modules `library*` import mpm_ref. Bits can be compared
only between machines of the same kind and libraries of the same versions; the file names both.
"""
