"""What Busch et al. 2022 found, and whether it holds on the shipped campaign."""

import numpy as np

from planner.studies.busch2022_data import FREQUENCY_MODELS, FUSIONS, KERNELS
from planner.studies.busch2022_frf import Rebuilt
from planner.studies.report import PaperClaim

FEW = 5  # poses at most that are called few


def findings(
    seven: np.ndarray, eight: np.ndarray, ten: np.ndarray, eleven: np.ndarray, twelve: Rebuilt,
    counts: tuple[int, ...],
) -> tuple[PaperClaim, ...]:  # fmt: skip
    """From scores (outputs, models, 3): R², RMSE, coverage; in 8 by count, in 11 by residue."""
    return (
        *_about_figure_7(seven),
        *_about_figure_8(eight, counts),
        *_about_the_rest(ten, eleven),
        _about_frfs(twelve),
    )


def _about_figure_7(seven: np.ndarray) -> tuple[PaperClaim, ...]:
    r2 = dict(zip(FREQUENCY_MODELS, seven[..., 0].T, strict=True))
    rmse = dict(zip(FREQUENCY_MODELS, np.median(seven[..., 1], axis=0), strict=True))
    high = np.mean([r2[name] > 0.9 for name in FUSIONS])
    plain = min(rmse[name] for name in ("linear", "quadratic", "cubic"))
    return (
        PaperClaim(
            "With 15 poses RBF, AR1 and NARGP mostly reach R² > 0.9.",
            f"in {100 * high:.0f} % of modes and models; least "
            + ", ".join(f"{n} {r2[n].min():.3f}" for n in FUSIONS),
            bool(high > 0.5),
        ),
        PaperClaim(
            "Linear, quadratic and cubic kernels cannot follow the frequencies.",
            f"median RMSE at best {plain:.2f} Hz, RBF {rmse['rbf']:.2f} Hz",
            plain > 2 * rmse["rbf"],
        ),
    )


def _about_figure_8(eight: np.ndarray, counts: tuple[int, ...]) -> tuple[PaperClaim, ...]:
    few = np.median(eight[[n <= FEW for n in counts]], axis=(0, 1))  # 3 to 5 poses: (models, 3)
    ready = [_first_above(eight[:, :, i, 0], counts) for i in range(3)]
    rough = [_roughness(eight[:, :, i, 1]) for i in (1, 2)]
    return (
        PaperClaim(
            "With few poses both fusions are notably better than the GP.",
            f"RMSE with 3 to 5 poses: RBF {few[0, 1]:.2f}, AR1 {few[1, 1]:.2f}, "
            f"NARGP {few[2, 1]:.2f} Hz",
            max(few[1, 1], few[2, 1]) < 0.7 * few[0, 1],
        ),
        PaperClaim(
            "AR1 needs the fewest poses (median mode at R² ≥ 0.9 from then on).",
            f"RBF {ready[0]}, AR1 {ready[1]}, NARGP {ready[2]} poses",
            ready[1] <= min(ready),
        ),
        PaperClaim(
            "NARGP fluctuates, AR1 does not.",
            f"RMSE rises with one more pose by {100 * rough[0]:.0f} % (AR1) and "
            f"{100 * rough[1]:.0f} % (NARGP) on average",
            rough[1] > 1.5 * rough[0],
        ),
        PaperClaim(
            "With 3 poses the GP is over-confident, AR1's interval is reliable.",
            f"inside the 95 % interval: RBF {100 * np.mean(eight[0, :, 0, 2]):.0f} %, "
            f"AR1 {100 * np.mean(eight[0, :, 1, 2]):.0f} %",
            bool(np.mean(eight[0, :, 0, 2]) < 0.8 < np.mean(eight[0, :, 1, 2])),
        ),
    )


def _first_above(r2: np.ndarray, counts: tuple[int, ...]) -> int:
    """Least count from which the median mode's R² (counts, modes) stays at 0.9."""
    good = np.median(r2, axis=1) >= 0.9
    below = np.flatnonzero(~good)
    return counts[min(int(below[-1]) + 1, len(counts) - 1)] if len(below) else counts[0]


def _roughness(rmse: np.ndarray) -> float:
    """Mean relative rise of the RMSE (counts, modes) from one count to the next."""
    return float(np.mean(np.maximum(rmse[1:] / rmse[:-1] - 1, 0.0)))


def _about_the_rest(ten: np.ndarray, eleven: np.ndarray) -> tuple[PaperClaim, ...]:
    damping = dict(zip(KERNELS, ten[..., 0].T, strict=True))
    rmse = dict(zip(KERNELS, np.median(ten[..., 1], axis=0), strict=True))
    imaginary = np.median(eleven[1::2, ..., 1], axis=(0, 1))
    real = np.median(eleven[::2, ..., 1], axis=(0, 1))
    return (
        PaperClaim(
            "No kernel follows the damping ratios.",
            "R² of RBF " + ", ".join(f"{v:.2f}" for v in damping["rbf"]) + " for modes 1 to 4: "
            "this robot's damping is C = βK with scatter, so it follows the pose",
            float(np.max(damping["rbf"])) < 0.5,
        ),
        PaperClaim(
            "RBF is best for damping, yet a cubic kernel is advised (it overfits less).",
            f"median RMSE: bias {rmse['bias']:.3f}, cubic {rmse['cubic']:.3f}, "
            f"RBF {rmse['rbf']:.3f} %",
            rmse["cubic"] <= rmse["rbf"],
        ),
        PaperClaim(
            "Residues are best modelled with RBF, imaginary parts above all.",
            f"median RMSE of imaginary parts: RBF {imaginary[-1]:.3f}, next "
            f"{np.min(imaginary[:-1]):.3f}; of real parts: RBF {real[-1]:.4f}, next "
            f"{np.min(real[:-1]):.4f}",
            bool(imaginary[-1] < np.min(imaginary[:-1])),
        ),
    )


def _about_frfs(twelve: Rebuilt) -> PaperClaim:
    predicted, best = (
        ", ".join(f"{v:.3f}" for v in r2) for r2 in (twelve.predicted_r2, twelve.measured_r2)
    )
    return PaperClaim(
        "FRFs put together from five poses' modes agree with those measured (figure 12).",
        f"R² of |H| {predicted} for xx, xy, yx, yy, {best} with the four modes measured there "
        f"(modes above them are missing); {100 * twelve.inside:.0f} % within the 95 % band",
        min(twelve.predicted_r2) > 0.9,
    )
