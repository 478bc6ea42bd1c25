"""LabVIEW measurement files, written by hand after the format's specification."""

from collections.abc import Sequence

from planner.recording.records import Hit

G = 9.80665
NAMES = ("Hammer", "acc X", "acc Y", "acc Z")


def lvm(
    hits: Sequence[Hit],
    x: str = "One",
    decimal: str = ".",
    separator: str = "\t",
    between: str = "",
    late: int = 0,
) -> str:
    """A LabVIEW measurement file, a segment a hit; accelerations begin `late` samples after."""
    head = f"""LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\t{"Tab" if separator == chr(9) else "Comma"}
Multi_Headings\tYes
X_Columns\t{x}
Time_Pref\tRelative
hit\t{hits[0].axis}
Date\t2026/03/01
Time\t08:00:00.5
***End_of_Header***\t
\t
"""
    blocks = [_lvm_segment(hit, f"08:0{k}:30.25", x, late) for k, hit in enumerate(hits)]
    text = (head + f"\n{between}\n".join(blocks)).replace(".", decimal)
    return text.replace("\t", separator)


def _lvm_segment(hit: Hit, stamp: str, x: str, late: int) -> str:
    step, many = 1 / hit.sampling_rate_hz, x == "Multi"
    columns = [
        v[late if k else 0 :] for k, v in enumerate([hit.force_n, *hit.acceleration_m_s2 / G])
    ]
    starts = [late * step if k else 0.0 for k in range(4)]
    tags = {"Channels": [4], "Samples": [len(v) for v in columns], "Date": ["2026/03/01"] * 4,
            "Time": [stamp] * 4, "Y_Unit_Label": ["N", "g", "g", "g"], "X_Dimension": ["Time"] * 4,
            "X0": [f"{s:.16E}" for s in starts], "Delta_X": [f"{step:.6f}"] * 4}  # fmt: skip
    gap = "\t\t" if many else "\t"
    lines = [f"{tag}\t{gap.join(map(str, cells))}{gap}" for tag, cells in tags.items()]
    lines += ["***End_of_Header***\t"]
    lines += [
        "\t".join([f"X_Value\t{n}" for n in NAMES] if many else ["X_Value", *NAMES]) + "\tComment"
    ]
    for row in range(max(map(len, columns))):
        cells = [f"{v[row]:.9g}" if row < len(v) else "" for v in columns]
        at = [f"{s + row * step:.6f}" if c else "" for s, c in zip(starts, cells, strict=True)]
        pairs = [c for pair in zip(at, cells, strict=True) for c in pair]
        lines.append("\t".join(pairs if many else ["" if x == "No" else at[0], *cells]))
    return "\n".join([*lines, ""])
