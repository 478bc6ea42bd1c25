"""The papers' studies again, on simulated recordings: tables, pictures, and whether they agree.

No recordings of the papers are public. What stands in for them comes from MuJoCo
(`planner.proof`), never from the planner's own simulation.
"""
