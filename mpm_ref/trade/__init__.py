"""Measure the trade of accuracy for time of a scene, and recommend settings.

reference   the solution that a family of refined grids approaches, with its own error
candidates  the settings that are tried
search      runs references and candidates within a budget
cost        the cost of finer grids of the reference
start       settings whose particles represent a body badly at the start
answer      the front, the recommended setting, and what is not known
"""
