"""Training of neural laws; the only part of `nclaw` that needs PyTorch."""
