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


def test_directions_are_spelled_by_axis_and_unknown_ones_refused() -> None:
    assert Dof.of_uff(7, -3) == Dof("7", "-z")
    assert str(Dof("P3", "y")) == "P3:y"
    assert [Dof.of_uff(1, number).is_turn for number in (2, 5)] == [False, True]
    for direction in ("w", "+x", "-scalar", ""):
        with pytest.raises(InputError, match="direction"):
            Dof("3", direction)
    with pytest.raises(InputError, match="direction 7"):
        Dof.of_uff(3, 7)
