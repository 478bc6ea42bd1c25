"""The program's version, which the logs of campaigns name."""

__version__ = "0.1.0"
