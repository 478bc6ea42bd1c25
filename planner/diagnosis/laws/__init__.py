"""Joints that are not linear: their laws, and the fits to recorded hits in time."""
