"""The table of proofs: a row for every test, whatever became of it."""

import subprocess
import sys

from tests.support.outside import with_tests

TESTS = """
import pytest

@pytest.fixture
def broken():
    raise RuntimeError("no set-up")

@pytest.fixture
def left():
    yield
    raise RuntimeError("no end")

def test_right(): pass
@pytest.mark.parametrize("x", ["a|b"])
def test_of(x): pass
def test_wrong(): assert False
@pytest.mark.skip(reason="no cell here")
def test_left_out(): pass
@pytest.mark.xfail(reason="known since long")
def test_known(): assert False
@pytest.mark.xfail(reason="known since long")
def test_mended(): pass
def test_broken(broken): pass
def test_that_does_not_end(left): pass
"""


def test_every_result_has_a_row(tmp_path):
    (tmp_path / "test_some.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\nxfail_strict = true\n")
    plugins = "-p", "tests.support.proof_table", "-p", "no:cacheprovider"
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *plugins, "--table", "found/table.md", "-n", "2"],
        cwd=tmp_path, capture_output=True, text=True, env=with_tests(), check=False,
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    table = (tmp_path / "found" / "table.md").read_text()
    assert table in done.stdout
    head, rule, *rows, last = [line.strip("| ").split(" | ") for line in table.splitlines()]
    assert head == ["test", "result", "seconds"]
    assert set("".join(rule)) <= set("-: |")
    assert {name.split("::")[-1]: result for name, result, _ in rows} == {
        "test_right": "passed",
        "test_of[a\\|b]": "passed",
        "test_wrong": "FAILED",
        "test_left_out": "skipped: no cell here",
        "test_known": "fails, as known: known since long",
        "test_mended": "FAILED",
        "test_broken": "ERROR in setup",
        "test_that_does_not_end": "ERROR in teardown",
    }
    assert last[0] == "all"
    assert "2 FAILED" in last[1]
    assert "2 passed" in last[1]
    assert float(last[2]) >= sum(float(seconds) for *_, seconds in rows) - 0.5
