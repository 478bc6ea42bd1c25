"""Ways to get tables and recordings wrong, by name."""

import numpy as np

CUTS = tuple(np.random.default_rng(7).uniform(size=5))  # where a file ends, of its length


def edited(lines: list[str], row: int, column: int, cell: str) -> list[str]:
    """The table with another cell."""
    cells = lines[row].split(",")
    cells[column] = cell
    return [*lines[:row], ",".join(cells), *lines[row + 1 :]]


def text(rows: list[str]) -> bytes:
    """A table's lines as a file."""
    return ("\n".join(rows) + "\n").encode()


def table_mutations(lines: list[str]) -> dict[str, bytes]:
    """Mutations that both tables share; columns 1…6 are joints, of which the ends are tried."""

    whole = text(lines)
    found = {
        "empty": b"",
        "header only": text(lines[:1]),
        "binary junk": bytes(range(256)) * 20,
        "no header": text(lines[1:]),
        "cut in a row": whole[: len(whole) // 2].rsplit(b",", 1)[0] + b"\n",
        "extra cell": text([lines[0], lines[1] + ",9", *lines[2:]]),
        "nul": whole.replace(b"1", b"\x00", 1),
        "duplicate column": text([lines[0].replace("joint_a2", "joint_a1"), *lines[1:]]),
        "wrong joint name": text([lines[0].replace("joint_a2", "axis_2"), *lines[1:]]),
        "seventh joint": text([f"{lines[0]},joint_a7_deg", *(f"{line},0" for line in lines[1:])]),
        "radians columns": text([lines[0].replace("_deg", "_rad"), *lines[1:]]),
        "no pose name": text(edited(lines, 1, 0, "")),
    }
    for joint in (1, 6):
        found[f"joint {joint} missing"] = text(
            [",".join(c for i, c in enumerate(line.split(",")) if i != joint) for line in lines]
        )
        for cell in ("nan", "inf", "", "12,5", "abc", "1e99"):
            found[f"joint {joint} is {cell!r}"] = text(edited(lines, 1, joint, cell))
        found[f"joint {joint} beyond limit"] = text(edited(lines, 1, joint, "400"))
        found[f"joint {joint} in arc minutes"] = text(edited(lines, 1, joint, "9000"))
    return found


def recording_mutations(lines: list[str]) -> dict[str, bytes]:
    """Mutations of recordings.csv alone."""
    last = len(lines[0].split(",")) - 1

    return {
        "hit axis w": text(edited(lines, 1, last - 2, "+w")),
        "hit empty": text(edited(lines, 1, last - 2, "")),
        "repeat a word": text(edited(lines, 1, last - 1, "first")),
        "repeat half": text(edited(lines, 1, last - 1, "1.5")),
        "file missing": text(edited(lines, 1, last, "data/none.uff")),
        "file outside": text(edited(lines, 1, last, "../predict.csv")),
        "file empty": text(edited(lines, 1, last, "")),
        "file junk name": text(edited(lines, 1, last, "data/\x7f" * 300)),
        "same row twice": text([*lines, lines[1]]),
        "same repeat twice": text(edited(lines, 2, last - 1, "1")),
        "pose elsewhere": text(edited(lines, 2, 1, "39")),
    }


def hit_file_mutations(good: bytes) -> dict[str, bytes]:
    """Mutations of a universal file with a hit."""
    # All-ones bytes are a NaN in every binary float format.
    half = len(good) // 2
    found = {
        "empty": b"",
        "binary junk": np.random.default_rng(7).bytes(5000),
        "nan samples": good[:half] + b"\xff" * 64 + good[half + 64 :],
        "zeros": b"\x00" * 4000,
    }
    for cut in CUTS:
        found[f"cut at {100 * cut:.2f} %"] = good[: 1 + int(cut * (len(good) - 2))]
    return found


def bad_columns(good: dict[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
    """Mutations of a hit's named columns (n,)."""
    uneven = good["time_s"].copy()
    uneven[50:] += 0.01
    spoilt = good["force_n"].copy()
    spoilt[10] = np.nan
    without = {f"no {name}": {k: v for k, v in good.items() if k != name} for name in good}
    return {
        **without,
        "uneven": {**good, "time_s": uneven},
        "backwards": {**good, "time_s": good["time_s"][::-1]},
        "nan": {**good, "force_n": spoilt},
        "silent": {**good, "force_n": np.zeros_like(spoilt)},
        "negative": {**good, "force_n": -good["force_n"]},
        "noise only": {**good, "force_n": np.random.default_rng(0).standard_normal(spoilt.size)},
        "clipped": {**good, "acceleration_x_m_s2": np.clip(good["acceleration_x_m_s2"], -1, 1)},
        "two samples": {k: v[:2] for k, v in good.items()},
        "swapped": {
            **good,
            "force_n": good["acceleration_y_m_s2"],
            "acceleration_y_m_s2": good["force_n"],
        },
        "force in an unknown unit": {
            ("force_parsec" if k == "force_n" else k): v for k, v in good.items()
        },
    }
