"""Mutations of valid files through the readers: refused in words or read, never a crash or hang."""

import gzip
import resource
import shutil
import signal
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.config import load_campaign_config
from planner.campaign.journal import Journal
from planner.dataset.screened_files import Source, read_files
from planner.errors import PlannerError, RefusedError
from planner.frf.matrix import from_records
from planner.proof.hits import Hammer, SimulatedHit
from planner.proof.recordings import write_uff
from planner.recording.folder import read_poses, read_recordings
from planner.robot.robot import Robot
from tests.support.containers import MANY_HITS, ONE_HIT
from tests.support.hit_files import WRITERS, columns, write_mat
from tests.support.outside import call, make_cell
from tests.support.simulated_hits import RATE_HZ, make_hit
from tests.support.uff_files import dataset_58, units_164, write

LONGEST_S, LARGEST_GIB = 10, 2
BAND = (4.0, 60.0)
CONTAINERS = ("MAT: signals of a measuring program", "MAT: a cell array of columns",
              "MAT 7.3: a list of channels", "LVM: many x columns, decimal commas",
              "TDMS: a group a hit", "HDF5: a table")  # fmt: skip
EXTREMES = (b"nan", b"inf", b"-1", b"0", b"1e308", b"-1e-300", b"99999999999999999999", b"", b"x",
            b"2147483648", b"-inf", b"1" * 400)  # fmt: skip


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """One to three changes: bytes, cuts, copies, runs, numbers of a text."""
    made = bytearray(data)
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        at = int(rng.integers(len(made) or 1))
        span = int(rng.integers(1, 1 + min(64, max(1, len(made)))))
        kind = rng.integers(8)
        if kind == 0:
            for place in rng.integers(len(made) or 1, size=int(rng.integers(1, 4))):
                if made:
                    made[place] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del made[at:]
        elif kind == 2:
            made[at:at] = made[at : at + 40 * span]
        elif kind == 3:
            made[at : at + span] = rng.bytes(span)
        elif kind == 4:
            made[at : at + span] = bytes([int(rng.choice([0, 32, 255, 10, 34]))]) * span
        elif kind == 5:
            made[at:at] = bytes([int(rng.choice([32, 40, 44, 49, 9]))]) * int(rng.integers(20_000))
        elif kind == 6:
            del made[at : at + span]
        else:
            numbers = [k for k in range(min(len(made), 4000)) if 48 <= made[k] <= 57]
            if numbers:
                place = int(rng.choice(numbers))
                made[place : place + 1] = EXTREMES[int(rng.integers(len(EXTREMES)))]
    return bytes(made)


def judge(path: Path) -> None:
    """What an import does with a file until it is an FRF; raises what it was refused for."""
    files = read_files((Source(path, path.name),), BAND)
    if files.records:
        from_records(files.records)
    if not files.verdicts[0].accepted:
        raise RefusedError(files.verdicts[0].reason)


def subjects(folder: Path) -> list[tuple[Path, Callable[[Path], object]]]:
    """Valid files, and what reads them."""
    hit = make_hit(np.random.default_rng(0), record_s=1.0)
    table = columns(hit, RATE_HZ)
    hammer = Hammer(sampling_rate_hz=RATE_HZ)
    write_uff(folder / "hit.uff", SimulatedHit("+x", hit.force_n, hit.acceleration_m_s2), hammer)
    for suffix, write_one in WRITERS.items():
        write_one(folder / f"hit{suffix}", table)
    (folder / "hit.csv.gz").write_bytes(gzip.compress((folder / "hit.csv").read_bytes()))
    lines = np.linspace(0.0, 100.0, 100)
    frfs = {"frequency_hz": lines, **{f"accelerance_{a}x": lines + 1j for a in "xyz"}}
    write_mat(folder / "frf.mat", frfs)
    recordings = [folder / f"hit.{s}" for s in ("uff", "csv", "h5", "mat", "tdms", "csv.gz")]
    for what in CONTAINERS:
        name, write = (ONE_HIT | MANY_HITS)[what]
        write(folder / f"of_{name}", [hit])
        recordings.append(folder / f"of_{name}")
    others = _as_people_write_them(folder, table)
    read = [(path, judge) for path in (*recordings, folder / "frf.mat", *others)]
    robot, plan, _ = make_cell(folder)
    assert call("new", folder / "cell", "--robot", robot, "--campaign", plan)[0] == 0
    names = Robot.load(robot).joint_names
    header = ",".join(f"{name}_deg" for name in names)
    angles = ",".join(["1.5"] * len(names))
    (folder / "recordings.csv").write_text(
        f"pose,{header},hit,repeat,file\nP1,{angles},+x,1,hit.uff\n"
    )
    (folder / "poses.csv").write_text(f"pose,{header}\nP1,{angles}\nP2,{angles}\n")
    return [
        *read,
        (folder / "recordings.csv", lambda path: read_recordings(path.parent, names)),
        (folder / "poses.csv", lambda path: read_poses(path, names)),
        (robot, Robot.load),
        (robot.parent / "arm.urdf", lambda path: Robot.load(path.with_name("robot.toml"))),
        (plan, load_campaign_config),
        (folder / "cell" / "log.jsonl", Journal),
    ]


def _as_people_write_them(folder: Path, table: dict[str, np.ndarray]) -> list[Path]:
    """The hit with decimal commas in UTF-16, FRFs as text, and a system of units of its own."""
    names = [*table]
    rows = ["\t".join(f"{table[n][i]:.6g}" for n in names) for i in range(len(table["time_s"]))]
    text = "# hit: +x\n" + "\t".join(names) + "\n" + "\n".join(rows).replace(".", ",")
    (folder / "german.txt").write_text(text, encoding="utf-16")
    frf = ["# hit: +x", "# response: +x", "Freq [Hz];Magnitude (dB re 1 m/s²/N);Phase [deg]"]
    frf += [f"{f:.2f};{-f:.3f};{f:.1f}" for f in np.arange(1.0, 90.0, 0.5)]
    (folder / "frf.txt").write_text("\n".join(frf))
    force, answer = (13, "Force", "NONE"), (12, "Acceleration", "NONE")
    samples = [table["force_n"], *(table[f"acceleration_{a}_m_s2"] for a in "xyz")]
    sets = [dataset_58(1, samples[0], force, felt=(1, 1), step=1 / RATE_HZ)]
    sets += [dataset_58(1, s, answer, felt=(2, k), step=1 / RATE_HZ)
             for k, s in enumerate(samples[1:], 1)]  # fmt: skip
    write(folder / "inch.uff", units_164(7, 39.37007874, 0.2248089431), *sets)
    return [folder / name for name in ("german.txt", "frf.txt", "inch.uff")]


def late(*_: object) -> None:
    raise TimeoutError


def fuzzed(folder: Path, count: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Outcomes by file, and what no reader may do."""
    rng = np.random.default_rng(seed)
    each = subjects(folder)
    seen, wrong = Counter[str](), []
    before = signal.signal(signal.SIGALRM, late)
    try:
        for number in range(count):
            good, read = each[number % len(each)]
            kept = good.read_bytes()
            good.write_bytes(mutated(kept, rng))
            signal.alarm(LONGEST_S)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    read(good)
                seen[f"{good.name} read"] += 1
            except PlannerError as error:
                seen[f"{good.name} refused"] += 1
                if not str(error).strip().endswith((".", "]", "ROBOT_TOML")):
                    wrong.append(f"{number} {good.name}: no sentence: {error}")
            except Exception as error:
                wrong.append(f"{number} {good.name}: {type(error).__name__}: {error}")
                shutil.copy(good, folder / f"wrong-{number}-{good.name}")
            finally:
                signal.alarm(0)
                good.write_bytes(kept)
    finally:
        signal.signal(signal.SIGALRM, before)
    return seen, wrong


@pytest.mark.parametrize(
    "count", [200, pytest.param(2000, marks=[pytest.mark.slow, pytest.mark.timeout(1800)])]
)
def test_mutated_files(tmp_path, count):
    seen, wrong = fuzzed(tmp_path, count, seed=1)
    print("\n" + "\n".join(f"{what}: {n}" for what, n in sorted(seen.items())))
    print("\n".join(wrong[:40]))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    assert not wrong
    assert peak < LARGEST_GIB * 2**30
