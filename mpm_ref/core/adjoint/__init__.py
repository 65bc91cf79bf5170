"""Adjoints of the kernels of `core`: each file has the name of the file it differentiates."""
