"""Measure the trade of accuracy for time of a scene, and recommend settings.

reference   the solution that a family of refined grids approaches, with its own error
candidates  the settings that are tried
search      runs references and candidates within a budget
answer      the front, the recommended setting, and what is not known
"""
