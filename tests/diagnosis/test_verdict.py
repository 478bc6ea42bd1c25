"""What a verdict's findings are."""

from typing import cast

from planner.diagnosis.verdict import NamedEffect, Verdict
from planner.effects.resonator import LinkResonator
from planner.fit.fitted import StructureFit


def test_two_hoses_on_one_link_are_two_findings():
    nothing = cast("StructureFit", None)  # no fit is asked
    hoses = [
        NamedEffect(LinkResonator(at, ()), 50.0, change, 1.0, counts)
        for at, change, counts in (
            ("link_4", 0.12, True),
            ("link_4#2", 0.05, True),
            ("link_2", 0.001, False),
        )
    ]
    found = Verdict("explained", tuple(hoses), (), (), nothing)
    assert [e.change for e in found.findings] == [0.12, 0.05]
    assert {e.place for e in found.findings} == {("local_resonator", "link_4")}
    assert Verdict("unexplained", tuple(hoses), (), (), nothing).findings == ()
