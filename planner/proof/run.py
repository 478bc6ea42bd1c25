"""Concealed cases: made by another process, diagnosed by the public command, unsealed."""

import hashlib
import json
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner import program
from planner.errors import InputError

SEALS = "seals.json"
LIMIT_S = 1800


@dataclass(frozen=True)
class Proof:
    """A folder of cases, and the hash of every case's sealed answer."""

    folder: Path
    seals: dict[str, str]
    whole: str  # hash of all hashes


def make(
    folder: Path,
    cases: int,
    seed: int,
    tell: Callable[[str, float], None],
    laboratory: bool = False,
) -> Proof:
    """Make the cases in a process of their own, unless the folder holds these very ones.

    In the `laboratory` hits are exact and the measuring chain is perfect; else both are everyday's.
    Raises InputError where it holds others, or where they cannot be made.
    """
    folder, stated = folder.absolute(), {"cases": cases, "seed": seed, "laboratory": laboratory}
    path = folder / SEALS
    if path.is_file():
        known = json.loads(path.read_text(encoding="utf-8"))
        if {k: known.get(k) for k in stated} != stated:
            raise InputError(f"{folder} holds other cases; name another folder with --out.")
        return _proof(folder, known["seals"])
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "planner.truth.cases", str(folder)]
    command += ["--cases", str(cases), "--seed", str(seed)]
    command += ["--laboratory"] if laboratory else []
    seals: dict[str, str] = {}
    with (
        open(folder / "making.log", "w", encoding="utf-8") as log,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as process,
    ):
        assert process.stdout is not None
        for line in process.stdout:
            name, seal = line.split()
            seals[name] = seal
            tell(f"making {name}", len(seals) / cases)
    if process.returncode or len(seals) != cases:
        raise InputError(f"The cases could not be made; see {folder / 'making.log'}.")
    path.write_text(json.dumps({**stated, "seals": seals}, indent=1), encoding="utf-8")
    return _proof(folder, seals)


def _proof(folder: Path, seals: dict[str, str]) -> Proof:
    text = "\n".join(f"{name} {seal}" for name, seal in sorted(seals.items()))
    return Proof(folder, seals, hashlib.sha256(text.encode()).hexdigest())


def diagnose_all(proof: Proof, jobs: int, tell: Callable[[str, float], None]) -> None:
    """Run the public command on every case that has no answer yet."""
    waiting = [name for name in sorted(proof.seals) if not told(proof, name).is_file()]
    done = len(proof.seals) - len(waiting)
    with ThreadPoolExecutor(max_workers=jobs) as pool:
        for future in as_completed([pool.submit(_diagnose, proof, name) for name in waiting]):
            done += 1
            tell(f"diagnosed {future.result()}", done / len(proof.seals))


def told(proof: Proof, name: str) -> Path:
    """Where the diagnosis of a case stands."""
    return proof.folder / "diagnosed" / f"{name}.json"


def _diagnose(proof: Proof, name: str) -> str:
    case, path = proof.folder / name, told(proof, name)
    path.parent.mkdir(exist_ok=True)
    command = program.command(
        "diagnose", str(case / "recordings"), "--robot", str(case / "robot" / "robot.toml"),
        "--predict", str(case / "recordings" / "predict.csv"), "--json",
    )  # fmt: skip
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
        text = run.stdout if run.returncode in (0, 3) else json.dumps({"failed": run.stderr})
    except subprocess.TimeoutExpired:
        text = json.dumps({"failed": f"took over {LIMIT_S} s"})
    whole = path.with_suffix(".part")
    whole.write_text(text, encoding="utf-8")
    whole.replace(path)
    return name


def unseal(proof: Proof, name: str) -> dict[str, Any]:
    """The sealed answer; InputError if it is not the one whose hash was printed."""
    text = (proof.folder / "answers" / f"{name}.json").read_text(encoding="utf-8")
    if hashlib.sha256(text.encode()).hexdigest() != proof.seals[name]:
        raise InputError(f"The answer of {name} was changed after it was sealed; prove anew.")
    return json.loads(text)
