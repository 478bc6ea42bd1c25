"""Degrees of freedom: node and signed direction, as universal files number them."""

import pytest

from planner.errors import InputError
from planner.recording.dof import Dof


@pytest.mark.parametrize("number", range(-6, 7))
def test_a_direction_number_comes_back(number: int) -> None:
    dof = Dof.of_uff(12, number)
    assert (dof.node, dof.number) == ("12", number)
    assert dof.positive.number == abs(number)
    assert dof.sign * dof.positive.number == number


def test_signed_directions_are_spelled_by_axis() -> None:
    assert Dof.of_uff(7, -3) == Dof("7", "-z")
    assert str(Dof("P3", "y")) == "P3:y"
    assert Dof.of_uff(1, 5).is_turn
    assert not Dof.of_uff(1, 2).is_turn


def test_unknown_directions_are_refused() -> None:
    for direction in ("w", "+x", "-scalar", ""):
        with pytest.raises(InputError, match="direction"):
            Dof("3", direction)
    with pytest.raises(InputError, match="direction 7"):
        Dof.of_uff(3, 7)
