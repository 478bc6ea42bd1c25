"""Recordings for the Rerun viewer: a campaign told step by step, and the plots of any answer."""
