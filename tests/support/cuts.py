"""A slot cut by two teeth, as cut.toml; speeds (rpm), depths (m) and method are to be given."""

SLOT = """teeth = 2
diameter_m = 0.02
milling = "slot"
radial_immersion = 1.0
kt_n_m2 = 6.0e8
kr_n_m2 = 2.0e8
feed = [1.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
spindle_rpm = [{}]
depth_m = [{}]
method = "{}"
"""
