"""Timings: never asserted in tests, always ratios measured in one run."""
