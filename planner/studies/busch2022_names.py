"""What Busch et al. 2022's study compares, in the order of its scores."""

KERNELS = ("bias", "linear", "quadratic", "cubic", "rbf")
FUSIONS = ("rbf", "AR1", "NARGP")
FREQUENCY_MODELS = (*KERNELS[1:], *FUSIONS[1:])
COUNTS = tuple(range(3, 16))  # B_3 … B_15
RESIDUES = tuple(f"{d} {part}" for d in ("xx", "yy") for part in ("real", "imaginary"))
