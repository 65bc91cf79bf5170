"""Training of reduced models' networks. The only part of `rom` that needs PyTorch."""
