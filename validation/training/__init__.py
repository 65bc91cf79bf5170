"""Training of the stored networks and laws that the experiments use. It needs PyTorch."""
