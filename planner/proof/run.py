"""Concealed cases: made by a process of their own, sealed, diagnosed by the command, unsealed."""

import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.compare import processes
from planner.errors import InputError
from planner.frf import metrics
from planner.proof.score import Scored, named_imperfections, score

STATED = "proof.json"
LIMIT_S = 1800


@dataclass(frozen=True)
class Proof:
    """Which cases: they hang on these numbers alone."""

    cases: int
    seed: int
    laboratory: bool = False


@dataclass(frozen=True)
class Task:
    """A case of a proof; where it is made: a folder that stays, or one for the meantime."""

    proof: Proof
    number: int
    folder: Path | None

    @property
    def name(self) -> str:
        """As in the report."""
        return f"case_{self.number:03d}"


def results(
    proof: Proof,
    folder: Path,
    jobs: int,
    scheduler: str | None,
    progress: Callable[[str, float], None],
) -> dict[str, Scored]:
    """Every case of a proof, scored; each is kept in `folder` as it comes, and not done again.

    On a Dask cluster, whose workers need not see the folder, or on `jobs` processes. Raises
    InputError where the folder holds another proof, or where a case cannot be made.
    """
    _claim(proof, folder)
    tasks = [Task(proof, k + 1, folder if scheduler is None else None) for k in range(proof.cases)]
    found = {t.name: _unsealed(folder, t.name) for t in tasks if _path(folder, t.name).is_file()}
    todo = [t for t in tasks if t.name not in found]
    for index, answer in processes.each(conducted, None, todo, jobs, scheduler):
        name = todo[index].name
        if isinstance(answer, processes.Failure):
            raise InputError(f"{name} could not be made: {answer.reason}")
        part = _path(folder, name).with_suffix(".part")
        part.write_text(json.dumps(answer), encoding="utf-8")
        part.replace(_path(folder, name))
        found[name] = _unsealed(folder, name)
        right = "right" if found[name].right else "wrong"
        progress(f"{name} {found[name].verdict}, {right}", len(found) / proof.cases)
    return {name: found[name] for name in sorted(found)}


def seal(folder: Path) -> str:
    """Hash of the hashes of all sealed answers."""
    kept = [
        json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("case_*.json"))
    ]
    return hashlib.sha256("\n".join(one["seal"] for one in kept).encode()).hexdigest()


def _claim(proof: Proof, folder: Path) -> None:
    path, stated = folder / STATED, json.dumps(vars(proof))
    if path.is_file() and path.read_text(encoding="utf-8") != stated:
        raise InputError(f"{folder} holds other cases; name another folder with --out.")
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(stated, encoding="utf-8")


def _path(folder: Path, name: str) -> Path:
    return folder / f"{name}.json"


def _unsealed(folder: Path, name: str) -> Scored:
    """Its score; InputError if the answer is not the one that was sealed."""
    kept = json.loads(_path(folder, name).read_text(encoding="utf-8"))
    if hashlib.sha256(kept["answer"].encode()).hexdigest() != kept["seal"]:
        raise InputError(f"The answer of {name} was changed after it was sealed; prove anew.")
    return score(name, json.loads(kept["answer"]), kept["told"])


def conducted(_: None, task: Task) -> dict[str, Any] | processes.Failure:
    """Make a case, seal its answer, and run the public command, which sees the recordings only."""
    with tempfile.TemporaryDirectory() as meantime:
        folder = (task.folder or Path(meantime)).absolute() / task.name
        answer = _made(task, folder)
        if isinstance(answer, processes.Failure):
            return answer
        sealed = hashlib.sha256(answer.encode()).hexdigest()
        told, true = diagnosed(folder), json.loads(answer)
        told["frac"] = _frac(true, told)
        named = [f"{effect}@{at}" for effect, at in named_imperfections(true, told)]
        # Made anew, elsewhere: a case that stays is as it was diagnosed.
        sizes = _made(task, Path(meantime) / "again", "--named", *named) if named else "{}"
        if isinstance(sizes, processes.Failure):
            return sizes
    told["imperfections"] = json.loads(sizes)
    return {"seal": sealed, "answer": answer, "told": told}


def _made(task: Task, folder: Path, *more: str) -> str | processes.Failure:
    """What is said of a case that is made, in a process of its own."""
    command = [sys.executable, "-m", "planner.proof.make", str(folder)]
    command += ["--cases", str(task.proof.cases), "--seed", str(task.proof.seed)]
    command += ["--number", str(task.number)]
    command += ["--laboratory"] if task.proof.laboratory else []
    made = subprocess.run([*command, *more], capture_output=True, text=True, check=False)
    if made.returncode:
        return processes.Failure((made.stderr.strip() or "nothing said").splitlines()[-1])
    return made.stdout


def diagnosed(case: Path) -> dict[str, Any]:
    """What the command says of a folder with recordings and robot; or why it failed."""
    command = [
        sys.executable, "-c", "from planner.cli import main; main()",
        "diagnose", str(case / "recordings"), "--robot", str(case / "robot" / "robot.toml"),
        "--predict", str(case / "recordings" / "predict.csv"), "--json",
    ]  # fmt: skip
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        return {"failed": f"took over {LIMIT_S} s"}
    return json.loads(run.stdout) if run.returncode in (0, 3) else {"failed": run.stderr}


def _frac(answer: dict[str, Any], told: dict[str, Any]) -> float | None:
    """Of the predictions with the true FRFs at poses that were never given."""
    if not answer["held_out"] or not told.get("npz") or not Path(told["npz"]).is_file():
        return None
    true = answer["held_out"]
    with np.load(told["npz"]) as file:
        lines, mean = file["frequency_hz"], np.abs(file["frf_mean"])
    size = np.abs(np.array(true["frf"][0]) + 1j * np.array(true["frf"][1]))
    at = np.array(true["frequency_hz"])
    inside = (at >= lines[0]) & (at <= lines[-1])
    flat = [np.interp(at[inside], lines, row) for row in mean.reshape(-1, len(lines))]
    simulated = np.array(flat).reshape(*mean.shape[:3], -1)
    return metrics.direct_mean(metrics.agreement(size[..., inside], simulated).global_frac)
