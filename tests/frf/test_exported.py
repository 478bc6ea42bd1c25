"""FRFs of files are used only with units, one grid and directions; conversions of quantities."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import InputError, RefusedError
from planner.frf.matrix import from_records, labelled_frfs, matrix_of
from planner.frf.quantities import DERIVATIVE, convert
from planner.milling import cutter_frf, tip_files
from planner.milling.tool import Point, Tool
from planner.recording.records import End, FrfRecord

LINES = np.arange(0.0, 100.0, 2.0)
TOOL = Tool("rod", (0.0, 0.0, 1.0), (), (Point("1", 0.0), Point("5", 0.02)))


def record(name: str, lines: np.ndarray = LINES, **changes) -> FrfRecord:
    """x and y, hit and felt at node 1."""
    places = tuple((End("1", i), End("1", j)) for i in (1, -2) for j in (1, 2))
    return replace(
        FrfRecord(
            Path(name), lines, np.ones((4, len(lines)), complex), places,
            "accelerance", "m/s^2/N", np.ones((4, len(lines))),
        ), **changes,
    )  # fmt: skip


def placed(response_node: str, response: int, hit: int) -> FrfRecord:
    """The second FRF is at another place."""
    first, _, *others = record("").places
    place = (End(response_node, response), End("1", hit))
    return record("b.uff", places=(first, place, *others))


SHIFTED = record("b.uff", LINES + 0.5)


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (SHIFTED, "b.uff has other frequency lines than a.uff; export one grid."),
        (record("b.uff", LINES[1:]), "export one grid"),
        (record("a.uff", LINES + 0.5), "a.uff mixes frequency lines; export one grid."),
        (record("b.uff", unit=""), "b.uff: it is not stated .* label them."),
        (record("b.uff", quantity="unknown"), "b.uff: it is not stated .* label them."),
        (placed("1", 0, 1), "b.uff: FRF 2 does not .* label them."),
        (placed("1", 1, 4), "b.uff: FRF 2 does not .* label them."),
    ],
)
def test_what_is_not_as_it_must_be_is_refused(second, words):
    for refusal in (InputError, RefusedError):
        with pytest.raises(refusal, match=words):
            labelled_frfs((record("a.uff"), second), "receptance", refusal)


def test_every_use_refuses_another_grid_of_the_same_length(tmp_path, monkeypatch):
    records = record("a.uff"), SHIFTED
    for made_of in (from_records, matrix_of):
        with pytest.raises(RefusedError, match="export one grid"):
            made_of(records)
    path = tmp_path / "a.uff"
    path.touch()
    for module in (tip_files, cutter_frf):
        monkeypatch.setattr(module, "read_frfs", lambda *_: records)
    with pytest.raises(InputError, match="export one grid"):
        tip_files.read_tip(path, TOOL, None, 0.0)
    with pytest.raises(InputError, match="export one grid"):
        cutter_frf.read_frf(path, None)


def test_lines_as_headers_round_them_are_the_same():
    lines, frfs = labelled_frfs(
        (record("a.uff"), record("b.uff", LINES * (1 + 1e-5))), "receptance", InputError
    )
    assert lines == pytest.approx(LINES[1:])
    assert [one[:2] for one in frfs[1:3]] == [(("1", 0), ("1", 1)), (("1", 1), ("1", 0))]
    assert frfs[2][2] == pytest.approx(1 / (2 * np.pi * lines) ** 2)


def test_what_other_nodes_and_rotations_have_is_left_out_where_nodes_are_named():
    others = placed("7", 1, 1), placed("1", 5, 1)
    _, frfs = labelled_frfs(others, "receptance", InputError, frozenset(("1", "5")))
    assert [felt for felt, *_ in frfs] == [("1", 0), ("1", 1), ("1", 1)] * 2


KINDS = st.sampled_from(sorted(DERIVATIVE))


def test_oscillator_of_known_mass_damping_and_stiffness():
    f = np.linspace(1.0, 60.0, 200)
    w, m, c, k = 2 * np.pi * f, 40.0, 300.0, 6e5
    receptance = 1 / (k - m * w**2 + 1j * c * w)
    # Force over motion instead, written out: dynamic mass and impedance.
    accelerance = 1 / (m + c / (1j * w) - k / w**2)
    mobility = 1 / (1j * w * m + c + k / (1j * w))
    np.testing.assert_allclose(convert(f, receptance, "receptance", "mobility"), mobility)
    np.testing.assert_allclose(convert(f, mobility, "mobility", "accelerance"), accelerance)
    np.testing.assert_allclose(convert(f, accelerance, "accelerance", "receptance"), receptance)


@settings(max_examples=30, deadline=None)
@given(KINDS, KINDS, KINDS, st.integers(0, 2**31))
def test_conversions_compose(a, b, c, seed):
    rng = np.random.default_rng(seed)
    f = np.sort(rng.uniform(0.5, 2000.0, 9))
    h = rng.normal(size=(2, 3, 9)) + 1j * rng.normal(size=(2, 3, 9))
    direct = convert(f, h, a, c)
    np.testing.assert_allclose(convert(f, convert(f, h, a, b), b, c), direct, rtol=1e-12)
    np.testing.assert_allclose(convert(f, direct, c, a), h, rtol=1e-12)


def test_what_cannot_be_converted_is_said():
    f, h = np.array([0.0, 1.0]), np.ones(2, complex)
    assert convert(f, h, "receptance", "accelerance")[0] == 0
    with pytest.raises(InputError, match="0 Hz of accelerance"):
        convert(f, h, "accelerance", "mobility")
    with pytest.raises(InputError, match="'compliance' is not known"):
        convert(f, h, "compliance", "mobility")
