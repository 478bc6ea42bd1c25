"""A pytest plugin: `pytest -m slow --table FILE` writes a table of name, result and seconds.

A row is written as soon as a test ends, so that a run of hours that is stopped leaves what it has.
"""

from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds --table."""
    text = "Write a table of all tests that ran (name, result, seconds) here, row by row."
    parser.addoption("--table", metavar="FILE", type=Path, help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Starts the table, in the process that hears of all tests."""
    path = config.getoption("--table")
    if path is not None and not hasattr(config, "workerinput"):
        config.pluginmanager.register(ProofTable(config.invocation_params.dir / path))


def result_of(report: pytest.TestReport) -> str:
    """What one of a test's three phases (setup, call, teardown) says of it; "" for nothing yet."""
    if report.skipped:
        if hasattr(report, "wasxfail"):
            return f"fails, as known: {report.wasxfail}"
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else ""
        return f"skipped: {reason.removeprefix('Skipped: ')}"
    if report.failed:
        return "FAILED" if report.when == "call" else f"ERROR in {report.when}"
    return "passed" if report.when == "call" else ""


class ProofTable:
    """Sums up the phases of each test, and writes its row after the last one."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.running: dict[str, tuple[str, float]] = {}
        self.count: dict[str, int] = {}
        self.seconds = 0.0
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("| test | result | seconds |\n| --- | --- | ---: |\n", encoding="utf-8")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Hears of one phase of a test."""
        before, spent = self.running.pop(report.nodeid, ("", 0.0))
        now, spent = result_of(report), spent + report.duration
        # An error in the teardown counts more than the result; nothing else comes after one.
        self.running[report.nodeid] = now or before, spent
        if report.when == "teardown":
            self._row(report.nodeid, *self.running.pop(report.nodeid))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Writes the sum, and shows the table."""
        total = ", ".join(f"{n} {what}" for what, n in sorted(self.count.items()))
        self._write("all", total or "no test", self.seconds)
        terminalreporter.section(f"table, kept in {self.path}")
        terminalreporter.write(self.path.read_text(encoding="utf-8"))

    def _row(self, name: str, result: str, seconds: float) -> None:
        kind = result.split(":", maxsplit=1)[0]
        self.count[kind] = self.count.get(kind, 0) + 1
        self.seconds += seconds
        self._write(name.removeprefix("tests/"), result, seconds)

    def _write(self, *cells: str | float) -> None:
        texts = [f"{c:.1f}" if isinstance(c, float) else " ".join(c.split()) for c in cells]
        with open(self.path, "a", encoding="utf-8") as file:
            file.write("| " + " | ".join(t.replace("|", "\\|") for t in texts) + " |\n")
