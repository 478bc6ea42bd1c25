"""Plan, use and explain impact-hammer tests of milling robots."""

__version__ = "0.1.0"
