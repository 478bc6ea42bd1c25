"""Concealed diagnosis cases made by an engine of its own; nothing here comes from planner's models.

SI units everywhere (N, m, kg, s, rad); degrees and millimetres where a name says so.
"""
