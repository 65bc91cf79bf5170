"""Mutations: the subject of each experiment is broken on purpose, and a verdict must change.

`validation/mutations.toml` lists what is broken (`listing`), `patch` breaks it in a process of its
own (`trial`), and `results/mutations.csv` has what followed (`table`).
"""
