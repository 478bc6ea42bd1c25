"""What Busch et al. 2022 found, and whether it holds on the shipped campaign."""

import numpy as np

from planner.studies.busch2022_data import FREQUENCY_MODELS, FUSIONS, KERNELS
from planner.studies.busch2022_frf import Rebuilt
from planner.studies.report import PaperClaim
from planner.surrogate.modal_surrogate import ModalObservations

FEW = 5  # poses at most that are called few


def findings(
    seven: np.ndarray, eight: np.ndarray, ten: np.ndarray, eleven: np.ndarray, twelve: Rebuilt,
    counts: tuple[int, ...], modes: ModalObservations,
) -> tuple[PaperClaim, ...]:  # fmt: skip
    """From scores (outputs, models, 3): R², RMSE, coverage; in 8 by count, in 11 by residue."""
    return (
        _about_figure_6(modes),
        *_about_figure_7(seven),
        *_about_figure_8(eight, counts),
        *_about_the_rest(ten, eleven),
        *_about_frfs(twelve),
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
            f"in {100 * high:.0f} % only",
        ),
        PaperClaim(
            "Linear, quadratic and cubic kernels cannot follow the frequencies.",
            f"median RMSE at best {plain:.2f} Hz, RBF {rmse['rbf']:.2f} Hz",
            plain > 2 * rmse["rbf"],
            f"the best of them is {plain / rmse['rbf']:.1f} times RBF's error only",
        ),
    )


def _about_figure_6(modes: ModalObservations) -> PaperClaim:
    """How well a line through simulated frequencies tells the measured ones."""
    r2 = []
    for low, high in zip(modes.simulated.frequency_hz.T, modes.frequency_hz.T, strict=False):
        known = np.isfinite(high)
        r2.append(float(np.corrcoef(low[known], high[known])[0, 1] ** 2))
    return PaperClaim(
        "The first frequency is nearly a linear function of the simulated one (figure 6).",
        "R² of a line " + ", ".join(f"{v:.3f}" for v in r2) + f" for modes 1 to {len(r2)}",
        r2[0] > 0.9,
        f"a line leaves {100 * (1 - r2[0]):.0f} % of the first one's variance",
    )


def _about_figure_8(eight: np.ndarray, counts: tuple[int, ...]) -> tuple[PaperClaim, ...]:
    few = np.median(eight[[n <= FEW for n in counts]], axis=(0, 1))  # 3 to 5 poses: (models, 3)
    ready = [_first_above(eight[:, :, i, 0], counts) for i in range(3)]
    shown = ", ".join(
        f"{name} {f'{n} poses' if n else f'not with {counts[-1]}'}"
        for name, n in zip(FUSIONS, ready, strict=True)
    )
    second = 100 * eight[0, 1, :, 2]
    covered = [100 * np.mean(eight[0, :, i, 2]) for i in range(5)]
    rough = [_roughness(eight[:, :, i, 1]) for i in (1, 2)]
    return (
        PaperClaim(
            "With few poses both fusions are notably better than the GP.",
            f"RMSE with 3 to 5 poses: RBF {few[0, 1]:.2f}, AR1 {few[1, 1]:.2f}, "
            f"NARGP {few[2, 1]:.2f} Hz",
            bool(max(few[1, 1], few[2, 1]) < 0.7 * few[0, 1]),
            f"AR1's RMSE is {few[1, 1] / few[0, 1]:.2f} of RBF's, "
            f"NARGP's {few[2, 1] / few[0, 1]:.2f}",
        ),
        PaperClaim(
            "AR1 needs the fewest poses (median mode at R² ≥ 0.9 from then on).",
            shown,
            bool(ready[1]) and ready[1] == min(n for n in ready if n),
            f"it gets there with {ready[1]}" if ready[1] else "it does not get there",
        ),
        PaperClaim(
            "NARGP fluctuates, AR1 does not.",
            f"RMSE rises with one more pose by {100 * rough[0]:.0f} % (AR1) and "
            f"{100 * rough[1]:.0f} % (NARGP) on average",
            rough[1] > 1.5 * rough[0],
            f"NARGP's rises {rough[1] / max(rough[0], 1e-9):.1f} times as much as AR1's",
        ),
        PaperClaim(
            "With 3 poses the GP is over-confident about ω₂, AR1 is reliable (figure 9).",
            f"inside the 95 % interval of ω₂: RBF {second[0]:.0f} %, AR1 {second[1]:.0f} %; of all "
            f"modes {covered[0]:.0f} and {covered[1]:.0f} %",
            bool(second[0] < 80 < second[1]),
            "AR1's, of the greatest likelihood from three poses, is over-confident too"
            if second[1] <= 80
            else "RBF's interval holds",
        ),
        PaperClaim(
            "With 3 poses, hyperparameters averaged, AR1's interval is reliable.",
            f"inside the 95 % interval: averaged AR1 {covered[4]:.0f} %, averaged RBF "
            f"{covered[3]:.0f} %",
            bool(covered[4] > 85),
            f"{100 - covered[4]:.0f} % lie outside, where 5 % should",
            ours=True,
        ),
    )


def _first_above(r2: np.ndarray, counts: tuple[int, ...]) -> int:
    """Least count from which the median mode's R² (counts, modes) stays at 0.9, 0 without one."""
    below = np.flatnonzero(np.median(r2, axis=1) < 0.9)
    first = int(below[-1]) + 1 if len(below) else 0
    return counts[first] if first < len(counts) else 0


def _roughness(rmse: np.ndarray) -> float:
    """Mean relative rise of the RMSE (counts, modes) from one count to the next."""
    return float(np.mean(np.maximum(rmse[1:] / rmse[:-1] - 1, 0.0)))


def _about_the_rest(ten: np.ndarray, eleven: np.ndarray) -> tuple[PaperClaim, ...]:
    damping: dict[str, np.ndarray] = dict(zip(KERNELS, ten[..., 0].T, strict=True))
    rmse = dict(zip(KERNELS, np.median(ten[..., 1], axis=0), strict=True))
    imaginary = np.median(eleven[1::2, ..., 1], axis=(0, 1))
    real = np.median(eleven[::2, ..., 1], axis=(0, 1))
    highest = max((float(v.max()), name) for name, v in damping.items())
    return (
        PaperClaim(
            "No kernel follows the damping ratios.",
            "R² of RBF " + ", ".join(f"{v:.2f}" for v in damping["rbf"]) + " for modes 1 to 4, "
            f"at most {highest[0]:.2f} by any kernel",
            highest[0] < 0.5,
            f"the {highest[1]} kernel reaches {highest[0]:.2f} in mode "
            f"{int(np.argmax(damping[highest[1]])) + 1}",
        ),
        PaperClaim(
            "RBF is best for damping, yet a cubic kernel is advised (it overfits less).",
            f"median RMSE: bias {rmse['bias']:.3f}, cubic {rmse['cubic']:.3f}, "
            f"RBF {rmse['rbf']:.3f} %",
            rmse["cubic"] <= rmse["rbf"] and rmse["bias"] >= rmse["cubic"],
            f"a constant (bias) is {100 * (rmse['cubic'] / rmse['bias'] - 1):.1f} % better than a "
            "cubic kernel"
            if rmse["bias"] < rmse["cubic"]
            else f"RBF is {100 * (rmse['cubic'] / rmse['rbf'] - 1):.1f} % better than a cubic "
            "kernel, on poses it was not trained with",
        ),
        PaperClaim(
            "Residues are best modelled with RBF, imaginary parts above all.",
            f"median RMSE of imaginary parts: RBF {imaginary[-1]:.3f}, next "
            f"{np.min(imaginary[:-1]):.3f}; of real parts: RBF {real[-1]:.4f}, next "
            f"{np.min(real[:-1]):.4f}",
            bool(imaginary[-1] < np.min(imaginary[:-1])),
            f"the {KERNELS[int(np.argmin(imaginary))]} kernel follows the imaginary parts better",
        ),
    )


def _about_frfs(twelve: Rebuilt) -> tuple[PaperClaim, ...]:
    published, ours, best = (
        ", ".join(f"{v:.2f}" for v in r2)
        for r2 in (twelve.published_r2, twelve.ours_r2, twelve.measured_r2)
    )
    return (
        PaperClaim(
            "FRFs put together from five poses' modes agree with those measured (figure 12).",
            f"R² of |H| {published} for xx, xy, yx, yy ({best} with the four modes measured "
            f"there); {100 * twelve.inside:.0f} % of lines within the 95 % band of "
            f"{twelve.draws} Sobol' points",
            min(twelve.published_r2) > 0.8,
            f"the least R² is {min(twelve.published_r2):.2f}; with the modes measured there, which "
            f"are known best, {twelve.measured_r2[int(np.argmin(twelve.published_r2))]:.2f}",
        ),
        PaperClaim(
            "The modes fused over the simulation agree at least as well.",
            f"R² of |H| {ours}; {100 * twelve.ours_inside:.0f} % of lines within the 95 % band",
            sum(twelve.ours_r2) >= sum(twelve.published_r2),
            f"{np.mean(twelve.ours_r2):.2f} against {np.mean(twelve.published_r2):.2f} in the mean",
            ours=True,
        ),
    )
