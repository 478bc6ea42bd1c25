"""No hit gets in at a pose where it was not hit, whatever happens in a session.

`EVERYDAY_SESSIONS` says how many campaigns are played, 200 as a rule, `EVERYDAY_FIRST` from which
seed on.
"""

import os
from collections import Counter

import pytest

from tests.support.everyday_sessions import everyday

COUNT = int(os.environ.get("EVERYDAY_SESSIONS", "200"))
FIRST = int(os.environ.get("EVERYDAY_FIRST", "0"))


@pytest.mark.slow
@pytest.mark.timeout(14400)
def test_no_hit_gets_in_at_a_pose_where_it_was_not_hit(tmp_path):
    done, faulty = Counter(), {}
    for seed in range(FIRST, FIRST + COUNT):
        engineer = everyday(tmp_path / f"{seed}", seed)
        done += engineer.done
        if engineer.faults:
            faulty[seed] = sorted(set(engineer.faults))
        print(seed, faulty.get(seed, "no fault"), flush=True)
    print(f"{COUNT} campaigns, {len(faulty)} faulty: {faulty}\n{dict(done)}")
    assert not faulty
    assert min(done[act] for act in ("late", "killed", "answered", "u", "U")) > COUNT / 10
    assert done["measured"] > 2 * COUNT
