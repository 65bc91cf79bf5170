"""mpm_ref: a readable, verified reference of five material point method papers."""

__version__ = "0.2.0"
