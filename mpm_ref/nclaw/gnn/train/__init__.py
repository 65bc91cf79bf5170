"""Training of the graph network that ours are compared with (`nclaw.gnn`)."""
