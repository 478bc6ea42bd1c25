"""Modes of a record whose force cannot be used: free decays after its hits."""

from dataclasses import replace

import numpy as np
from scipy.signal import find_peaks, peak_widths

from planner.errors import InputError, RefusedError
from planner.modal.estimate_modes import PoleIdentification, identify
from planner.modal.fit_data import Data
from planner.modal.mac import grouped, mac
from planner.modal.modes import UNSCALED, ModalModel, Mode
from planner.modal.residues import rank_one
from planner.recording.records import Channel, TimeRecord

# The decay starts where the force has fallen to this share of its peak, at latest after that time.
PULSE_END, PULSE_LONGEST_S = 0.02, 0.3
LEAST_DECAY_S = 1.0
# The decay is taken to last while its blocks hold this much more energy than the record's median.
BLOCK_S, ALIVE = 1.0, 1.5
MAX_ORDER = 30  # higher ones do not help with a handful of channels
MARGIN, LEAST_LINES = 0.15, 6  # beyond the band that is fitted too; that suffice


def analyse_record(
    record: TimeRecord, force_channel: str, band_hz: tuple[float, float] | None = None
) -> tuple[ModalModel, PoleIdentification]:
    """Modes of the free decays after each hit of a record; no use is made of the force's size.

    The hits are found in `force_channel`. `band_hz` defaults to what rate and length allow. Every
    mode's `shape` has one entry per responding channel, in the order that the remarks name;
    residues are NaN because nothing scales them. Remarks say which channels and pulses are faulty.
    Raises InputError for an unknown force channel and RefusedError where no mode can be found.
    Returned beside the modes is all that led to them (stabilisation diagram, fit).
    """
    remarks = [*record.remarks, *(fault.text for fault in record.faults)]
    force = next((c for c in record.channels if c.name == force_channel), None)
    if force is None:
        names = ", ".join(channel.name for channel in record.channels)
        raise InputError(f"{record.source} has no channel {force_channel!r}; it has {names}.")
    samples, names = _decays(record, force, remarks)
    rate = record.sampling_rate_hz
    band = band_hz or (max(10 * rate / samples.shape[-1], 0.01 * rate), 0.45 * rate)
    names, every, found = _identify_sound(samples, rate, names, band, remarks)
    sure = [mode for mode in every if mode.probability >= 0.5]
    kept = [mode for mode in sure if band[0] <= mode.frequency_hz <= band[1]]
    modes = tuple(_merged(group, remarks) for group in grouped(kept, _same))
    if found is None or not modes:
        raise RefusedError(
            f"{record.source}: no decaying oscillation stands out between {band[0]:g} and"
            f" {band[1]:g} Hz; record longer after the hit or hit harder."
        )
    remarks.append(
        "Modes are from free decays, shapes in the order "
        + ", ".join(names)
        + "; without a usable force they are not scaled."
    )
    return ModalModel(modes, band, found.fit_error, found.diagram.order, tuple(remarks)), found


def _decays(
    record: TimeRecord, force: Channel, remarks: list[str]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Responses (channels, decays, n) from the end of each pulse on, and the channels' names."""
    rate = record.sampling_rate_hz
    responses = [c for c in record.channels if c is not force]
    values = np.array([c.samples for c in responses], float)
    if values.size == 0:
        raise RefusedError(f"{record.source} holds no response channel; record accelerations.")
    starts = _pulse_ends(record, force, values.shape[1], remarks)
    ends = [*starts[1:], values.shape[1]]
    margin = round(0.05 * rate)  # the foot of the next pulse
    length = min(e - s for s, e in zip(starts, ends, strict=True)) - margin
    # Decays longer than this many samples are cut: their tail is noise.
    length = max(8, min(length, 8192, _lifetime(values, starts, length, rate)))
    samples = np.stack([values[:, s : s + length] for s in starts if s + length <= values.shape[1]])
    if not np.all(np.isfinite(samples)):
        raise RefusedError(f"{record.source}: the decays hold missing values; export them again.")
    return samples.transpose(1, 0, 2), tuple(c.name for c in responses)


def _pulse_ends(record: TimeRecord, force: Channel, samples: int, remarks: list[str]) -> list[int]:
    """Samples at which the pulses of the hits have ended, and remarks on them."""
    rate, size = record.sampling_rate_hz, np.abs(force.samples - np.median(force.samples))
    most, apart = float(np.max(size, initial=0.0)), round(LEAST_DECAY_S * rate)
    noise = max(float(np.median(size)), 1e-12 * most)
    # Out of the channel's own noise, and a good share of the largest.
    least, beyond = max(20 * noise, 0.15 * most), np.r_[0.0, size, 0.0]
    hits = find_peaks(beyond, least, distance=apart)[0] - 1
    hits = hits[hits < samples - apart]
    if not hits.size:
        raise RefusedError(
            f"{record.source}: no hit stands out of channel {force.name}; hit harder."
        )
    width = float(np.median(peak_widths(size, hits)[0]))
    # Samples above half the peak that a pulse needs for its amplitude to mean anything.
    if width < 4:
        remarks.append(
            f"The hammer pulse in {force.name} is under-sampled ({width:.0f} samples above half "
            f"its peak at {rate:g} Hz): its amplitude is useless and was not used."
        )
    if force.unit and force.unit != "N":
        remarks.append(f"{force.name} is in {force.unit}, not N: FRFs cannot be scaled.")
    long = max(2, round(PULSE_LONGEST_S * rate))
    loud = (np.flatnonzero(size[hit : hit + long] > PULSE_END * size[hit]) for hit in hits)
    return [int(hit + still[-1]) + 1 for hit, still in zip(hits, loud, strict=True)]


def _lifetime(values: np.ndarray, starts: list[int], length: int, rate: float) -> int:
    """Samples until the responses of the longest-lived decay have sunk to the background."""
    block = max(8, round(BLOCK_S * rate))
    count = length // block
    if count < 4:
        return length
    # Differences, because drifts would pass for background.
    steps = np.diff(values, axis=1, append=values[:, -1:])
    each = np.stack([steps[:, s : s + count * block] for s in starts])
    energy = np.sum(each.reshape(len(starts), len(values), count, block) ** 2, axis=3)
    level = energy / np.maximum(np.median(energy, axis=2, keepdims=True), 1e-300)
    alive = np.flatnonzero(np.max(np.median(level, axis=1), axis=0) < ALIVE)
    quiet = int(alive[0]) if alive.size else count
    return max(round(LEAST_DECAY_S * rate), (quiet + 1) * block)


def _identify_sound(
    samples: np.ndarray, rate: float, names: tuple[str, ...], band: tuple[float, float],
    remarks: list[str],
) -> tuple[tuple[str, ...], tuple[Mode, ...], PoleIdentification | None]:  # fmt: skip
    """Identify, leave out channels that the modes do not explain, identify again."""
    factor = np.std(samples, axis=(1, 2))[:, None]
    factor[factor == 0] = 1.0
    found = identify_decays(samples / factor[..., None], rate, band)
    if found is None or not found.modes:
        return names, (), found
    explained = _explained(found, band)
    # A channel responds if its energy in the band after the hit exceeds that at the end this much,
    # in units of the scatter of such a ratio, or if the modes found explain this share of it.
    sound = explained >= 0.2 * np.max(explained)
    if np.all(sound):
        modes = (
            replace(m, residue=m.residue * factor, residue_sd=m.residue_sd * factor,
                    shape=rank_one(m.residue * factor)[0])
            for m in found.modes
        )  # fmt: skip
        return names, tuple(modes), found
    for name, share in zip(np.array(names)[~sound], explained[~sound], strict=True):
        remarks.append(
            f"Sensor {name} does not follow the hits (the modes explain {100 * share:.0f} % of"
            " it): it was left out; check the sensor and its cable."
        )
    names = tuple(np.array(names)[sound].tolist())
    return _identify_sound(samples[sound], rate, names, band, remarks)


def _explained(found: PoleIdentification, band: tuple[float, float]) -> np.ndarray:
    """Share of each channel's energy in the band that the modes explain."""
    data = found.data
    inside = (data.frequency_hz >= band[0]) & (data.frequency_hz <= band[1])
    error = found.fit.error.reshape(data.response.shape)
    error = np.sum(np.abs(error[..., inside]) ** 2, axis=(1, 2))
    return 1 - error / np.sum(np.abs(data.response[..., inside]) ** 2, axis=(1, 2))


def _same(a: Mode, b: Mode) -> bool:
    """Whether neighbours are one mode: within a bandwidth, and of one shape.

    A mode whose frequency or damping changes as it dies away (friction, play) decays in several
    exponentials; two modes of one structure at one place would differ in shape.
    """
    width = max(a.damping_ratio * a.frequency_hz, b.damping_ratio * b.frequency_hz)
    return abs(a.frequency_hz - b.frequency_hz) < width and mac(a.shape, b.shape) > 0.95


def _merged(group: list[Mode], remarks: list[str]) -> Mode:
    energy = [float(np.sum(np.abs(m.residue) ** 2) / -m.pole.real) for m in group]
    strongest, (residue, sd) = group[int(np.argmax(energy))], UNSCALED
    main = replace(strongest, residue=residue, residue_sd=sd)
    if len(group) == 1:
        return main
    frequency = np.array([mode.frequency_hz for mode in group])
    damping = np.array([mode.damping_ratio for mode in group])
    remarks.append(
        f"The mode at {main.frequency_hz:.4g} Hz decays in {len(group)} exponentials of one shape"
        f" ({frequency.min():.5g} to {frequency.max():.5g} Hz, damping {damping.min():.2g} to"
        f" {damping.max():.2g}): it depends on amplitude; the strongest is given."
    )
    return replace(
        main,
        frequency_sd_hz=max(main.frequency_sd_hz, float(np.ptp(frequency)) / 2),
        damping_sd=max(main.damping_sd, float(np.ptp(damping)) / 2),
    )


def identify_decays(
    samples: np.ndarray, sampling_rate_hz: float, band_hz: tuple[float, float]
) -> PoleIdentification | None:
    """Modes of simultaneous channels over several decays, None where there is none.

    samples (channels, decays, n). Means are taken off; slower drifts stay below the band.
    """
    n = samples.shape[-1]
    frequency = np.fft.rfftfreq(n, 1 / sampling_rate_hz)
    low, high = band_hz[0] / (1 + MARGIN), band_hz[1] * (1 + MARGIN)
    chosen = (frequency >= low) & (frequency <= high) & (frequency > 0)
    # The highest line of an even DFT is real and holds no phase.
    chosen &= frequency < 0.499 * sampling_rate_hz
    if np.count_nonzero(chosen) < LEAST_LINES:
        return None
    centred = samples - np.mean(samples, axis=-1, keepdims=True)
    spectrum = np.fft.rfft(centred, axis=-1)[..., chosen]
    if not np.any(spectrum):
        return None
    data = Data(frequency[chosen], spectrum, None, step_s=1 / sampling_rate_hz)
    return identify(data, MAX_ORDER)
