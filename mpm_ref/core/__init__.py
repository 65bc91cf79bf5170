"""Arrays and leaf kernels: no objects, no files, no torch."""
