"""Node-embedding multigrid: a text on SciPy matrices, and in `blocks` its fast twin."""
