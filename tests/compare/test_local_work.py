"""Work on processes: all of it is done once, whatever dies."""

import os

import pytest

from planner.compare.processes import Failure, each
from tests.support import items


def test_every_item_is_done_by_other_processes():
    found = dict(each(items.doubled, 10, [3, 4, 5]))
    assert found == {0: 30, 1: 40, 2: 50}
    processes = set(dict(each(items.process_of, None, [0, 1, 2, 3])).values())
    assert os.getpid() not in processes
    assert len(processes) <= 2


def test_a_death_costs_one_item_which_is_done_again(tmp_path):
    found = dict(each(items.dying_once, str(tmp_path), [0, 1, 2, 3]))
    assert found == {0: 0, 1: 1, 2: 2, 3: 3}
    assert (tmp_path / "killed").exists()


@pytest.mark.parametrize(("work", "why"), [(items.deadly, "died"), (items.failing, "too odd")])
def test_an_item_that_kills_every_process_or_fails_is_given_up_and_the_rest_done(work, why):
    found = dict(each(work, None, [0, 1, 2]))
    assert (found[0], found[2]) == (0, 2)
    assert isinstance(found[1], Failure)
    assert why in found[1].reason


def test_stopping_early_leaves_no_process():
    import multiprocessing

    before = set(multiprocessing.active_children())  # an earlier test's helper may be there
    work = each(items.doubled, 1, list(range(50)))
    next(work)
    assert set(multiprocessing.active_children()) - before
    work.close()
    assert set(multiprocessing.active_children()) <= before
