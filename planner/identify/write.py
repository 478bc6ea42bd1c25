"""Identified springs into the text of a robot.toml, whose comments and order stay."""

import tomlkit

from planner.identify.result import Identification

DIGITS = 6  # significant ones: more than any identification knows


def updated_toml(text: str, result: Identification) -> str:
    """The robot.toml `text` with the [[compliance]] blocks' numbers replaced.

    Inertias are not in robot.toml: where they were identified too, the springs alone are written.
    """
    document = tomlkit.parse(text)
    blocks = document["compliance"]
    for estimate in result.estimates:
        for number in estimate.blocks:
            blocks[number][estimate.kind] = float(f"{estimate.value:.{DIGITS}g}")
    return tomlkit.dumps(document)
