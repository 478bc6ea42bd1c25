"""Tests of the planner; what they share is in `tests.support`."""
