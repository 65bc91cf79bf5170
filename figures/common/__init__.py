"""Common parts of the figures: panels, particle pictures, legends."""
