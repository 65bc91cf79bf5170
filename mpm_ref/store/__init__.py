"""Files of a run: results, checkpoints, manifests, weights; each is complete or not there.

This file imports nothing, so that low floors of the package can use `weights_file` and `memmap`.
"""
