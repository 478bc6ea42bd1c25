"""Concealed diagnosis cases made by an engine of its own; nothing here comes from `planner`.

A case is a robot as stated, recordings of the robot as it truly is, and a sealed answer. SI units
everywhere (N, m, kg, s, rad); degrees and millimetres where a name says so.

    python -m planner.proof.tree OUT --seed S [--kind NAME]
"""
