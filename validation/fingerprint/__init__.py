"""Fingerprints: what runs of every kind end with, to the bit, so that a change of the code that
should change no result can be shown to change none.

    python -m validation fingerprint record FILE        # before
    python -m validation fingerprint check FILE         # after: names each case that differs

`cases` lists the runs and `library` is the only module that knows mpm_ref. Bits can be compared
only between machines of the same kind and libraries of the same versions; the file names both.
"""
