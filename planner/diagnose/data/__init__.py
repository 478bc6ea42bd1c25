"""Recordings as the diagnosis looks at them: visits, force levels, columns of the FRF matrix."""
