"""The V-cycle on kernels of d x d blocks, tested against the text in `multigrid`."""
