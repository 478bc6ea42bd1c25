"""Rebuilding a campaign from its log, step by step, and checking each step."""

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from planner.campaign import store
from planner.campaign.build import build
from planner.campaign.campaign import Campaign
from planner.campaign.cell import Cell
from planner.campaign.events import (
    Configured,
    Entry,
    Imported,
    MeasuredMode,
    Proposal,
    Proposed,
)
from planner.campaign.labels import from_modal
from planner.campaign.low_fidelity import Recall, in_memory
from planner.campaign.model import Model
from planner.campaign.proposals import propose
from planner.campaign.state import CampaignState, Measurement, fold, without
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.store import Store
from planner.errors import InputError, NoPoseLeftError, PlannerError
from planner.words import counted

CLOSE = 1e-6  # relative; another processor rounds differently, another program errs by more


@dataclass(frozen=True, eq=False)
class Step:
    """One entry of the log, computed again: "identical", "close" (rounding), "differs", "kept".

    `instead`: what another acquisition would have proposed there.
    """

    entry: Entry
    check: str
    detail: str
    state: CampaignState  # after the entry
    model: Model
    measured: MeasuredPose | None = None
    instead: tuple[Proposal, ...] = ()


def _cell(directory: Path, configured: Configured, stack: ExitStack) -> Cell:
    """Of a configuration; earlier versions of the robot folder are laid out again."""
    root = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    store.restore_robot(directory, configured.robot, root / store.ROBOT)
    return Cell.load(root / configured.config.robot, configured.config)


def replay(
    campaign: Campaign, until: int | None = None, acquisition: str | None = None
) -> Iterator[Step]:
    """Each entry of the log up to number `until`, with what computing it again gives.

    `acquisition` is asked for what it would have proposed wherever the log proposes.

    Raises InputError if a recording that the log names is missing or changed.
    """
    entries = campaign.entries
    if until is not None and not 1 <= until <= len(entries):
        raise InputError(f"The log has entries 1 to {len(entries)}; {until} is not among them.")
    with ExitStack() as stack:
        # By configuration the cell, what was found, and models: those follow from measurements in
        # use alone, so that skips and undone acts leave them alone.
        known: dict[bytes, tuple[Cell, Recall, dict[tuple[Measurement, ...], Model]]] = {}
        model = None
        for entry in entries[:until]:
            before, after = fold(entries[: entry.seq - 1]), fold(entries[: entry.seq])
            check, detail, measured = _check(campaign, entry, before, model)
            instead = _instead(entry, before, model, acquisition)
            assert after.configured is not None
            key = msgspec.json.encode((after.configured.config, after.configured.robot))
            if key not in known:
                loaded = _cell(campaign.directory, after.configured, stack)
                known[key] = loaded, in_memory(), {}
            cell, recall, models = known[key]
            if after.used not in models:
                kept = store.KeptRecordings(campaign.directory, cell)
                models[after.used] = build(cell, after, kept.hits, recall)
            model = models[after.used]
            yield Step(entry, check, detail, after, model, measured, instead)


def _instead(
    entry: Entry, before: CampaignState, model: Model | None, acquisition: str | None
) -> tuple[Proposal, ...]:
    if acquisition is None or model is None or not isinstance(entry.event, Proposed):
        return ()
    try:
        return propose(model, before, entry.event.count, acquisition)
    except NoPoseLeftError:
        return ()


def _check(
    campaign: Campaign, entry: Entry, before: CampaignState, model: Model | None
) -> tuple[str, str, MeasuredPose | None]:
    event = entry.event
    if isinstance(event, Proposed) and model is not None:
        try:
            again = propose(model, before, event.count, event.acquisition)
        except PlannerError as error:
            return "differs", str(error), None
        numbers = [[(*p.joints_deg, p.score) for p in ps] for ps in (event.proposals, again)]
        names = ", ".join(p.pose for p in event.proposals)
        return (*_compare(numbers[0], numbers[1], names), None)
    if isinstance(event, Imported) and model is not None:
        return _check_import(campaign, event, before, model)
    return "kept", event.kind, None


def _check_import(
    campaign: Campaign, event: Imported, before: CampaignState, model: Model
) -> tuple[str, str, MeasuredPose]:
    known = without(before.measurements.get(event.pose), event.replaced)
    hits = (*(known.accepted if known else ()), *event.hits)
    sources = tuple(map(campaign.recordings.source, hits))
    table = model.cell.config.modes
    # Nothing that was kept is taken: to compute it again is what is asked for.
    rate, anew = table.window_rate_1_s, Store(None)
    measured = measure(sources, table.band_hz, window_rate_1_s=rate, store=anew)
    modes = from_modal(measured.modal)
    accepted = [v.accepted for v in measured.verdicts[len(hits) - len(event.hits) :]]
    if accepted != [hit.accepted for hit in event.hits]:
        return "differs", f"{event.pose}: other hits are refused than before", measured
    detail = f"{event.pose}: {counted(sum(accepted), 'hit')}, {counted(len(modes), 'mode')}"
    if event.unhit:
        detail = f"{event.pose}: {counted(len(event.hits), 'hit')} refused"
    detail += ", held until confirmed" if event.question else ""
    check, detail = _compare(_numbers(event.modes), _numbers(modes), detail)
    return check, detail, measured


def _numbers(modes: tuple[MeasuredMode, ...]) -> list[list[float]]:
    return [[m.frequency_hz, m.damping_ratio, m.frequency_sd_hz, m.damping_sd] for m in modes]


def _compare(logged: list, again: list, detail: str) -> tuple[str, str]:
    if [list(row) for row in logged] == [list(row) for row in again]:
        return "identical", detail
    a, b = np.array(logged, dtype=float), np.array(again, dtype=float)
    if a.shape == b.shape and np.allclose(a, b, rtol=CLOSE, atol=CLOSE, equal_nan=True):
        return "close", detail
    return "differs", detail
