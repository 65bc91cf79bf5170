"""A simulator by a graph network, the paper's baseline "gnn" (NCLAW-methods), without PyTorch.

It is that of [GNS]: points are the nodes of a graph, edges join those that are near each other.
What a point has done in the last frames, and where its neighbours are, gives its acceleration;
it knows no law, no grid and no balance of momentum. `gnn.train` trains it.
"""
