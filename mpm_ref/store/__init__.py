"""Files of runs: results, checkpoints, manifests and weights, each written atomically.

This module imports nothing, so that lower layers can use `weights_file` and `memmap`.
"""
