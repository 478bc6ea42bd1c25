"""Whether a robot's description can be believed: what looks wrong in robot.toml and its URDF."""
