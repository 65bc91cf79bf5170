"""Experiments of HOT: its figures and tables, on scenes that two cores can carry."""
