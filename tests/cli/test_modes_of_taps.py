"""`planner modes` of time histories of any points: one sensor, a roving hammer, a roving sensor."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from planner.proof.recordings import uff_channel, write_sets
from tests.support.hit_files import write_table
from tests.support.hit_structures import agree
from tests.support.outside import modes, only_told, refused, told
from tests.support.structures import Structure, plate

BAND = (25.0, 120.0)
PLATE = plate(3, 3)
NODES = range(len(PLATE.nodes))
NEAR = 2e-3, 0.1  # frequencies and damping, relative


RATE_HZ, SAMPLES, LONG = 1024.0, 1024, 16
PULSE_S, BEFORE_S, PEAK_N = 0.004, 0.1, 200.0
NOISE = 2e-3  # of the responses, by their rms


@dataclass(frozen=True, eq=False)
class Tap:
    """A hit at one degree of freedom (index) of a structure, felt at others: n samples each."""

    structure: Structure
    hit: int
    felt: tuple[int, ...]
    force_n: np.ndarray
    acceleration_m_s2: np.ndarray  # (r, n)


def tap(
    structure: Structure,
    hit: int,
    felt: tuple[int, ...],
    rng: np.random.Generator,
    second: float = 0.0,
) -> Tap:
    """Records of 1 s that end while the structure rings.

    Noise on the force is 5e-4 of its peak; `second`: relative size of a second pulse 30 ms later.
    """
    n = SAMPLES * LONG
    t = np.arange(n) / RATE_HZ
    pulses = [(BEFORE_S, 1.0), (BEFORE_S + 0.03, second)]
    force = sum(
        PEAK_N * size * np.sin(np.pi * np.clip((t - at) / PULSE_S, 0, 1)) ** 2
        for at, size in pulses
    )
    hz = np.fft.rfftfreq(n, 1 / RATE_HZ)
    h = np.zeros((len(felt), hz.size), complex)
    h[:, 1:] = structure.accelerance(hz[1:], list(felt), [hit])[:, 0]
    a = np.fft.irfft(h * np.fft.rfft(force), n, axis=1)[:, :SAMPLES]
    a = a + NOISE * np.std(a, axis=1, keepdims=True) * rng.standard_normal(a.shape)
    return Tap(structure, hit, felt, force[:SAMPLES] + 0.1 * rng.standard_normal(SAMPLES), a)


def write_uff(path: Path, taps: list[Tap], turned: bool = False) -> Path:
    """One hit after the other, labelled as simulated; responses along −z where `turned`."""
    sets, sign = [], -1 if turned else 1
    for one in taps:
        nodes = one.structure.nodes
        hit = nodes[one.hit], 3
        sets.append(uff_channel(one.force_n, RATE_HZ, hit, hit, force=True))
        for k, own in zip(one.felt, one.acceleration_m_s2, strict=True):
            sets.append(uff_channel(sign * own, RATE_HZ, (nodes[k], 3 * sign), hit))
    return write_sets(path, sets)


def write_csv(path: Path, one: Tap, columns: str, *attributes: str) -> Path:
    """Named columns, {} where the node goes, below lines of attributes ("hit: +z")."""
    nodes = [f"n{one.structure.nodes[k]}" for k in one.felt]
    names = ["time_s", "force_n", *(columns.format(node) for node in nodes)]
    rows = [np.arange(one.force_n.size) / RATE_HZ, one.force_n, *one.acceleration_m_s2]
    head = (f"# {text}" for text in attributes)
    return write_table(path, dict(zip(names, rows, strict=True)), *head)


def roving_hammer(folder, rng):
    return [write_uff(folder / f"{k}.uff", [tap(PLATE, k, (0,), rng)]) for k in NODES]


def roving_sensor(folder, rng):
    return [write_uff(folder / f"{k}.uff", [tap(PLATE, 0, (k,), rng)], turned=True) for k in NODES]


def one_file(folder, rng):
    return [write_uff(folder / "all.uff", [tap(PLATE, k, (0,), rng) for k in NODES])]


def repeats(folder, rng):
    every = [tap(PLATE, k, (0, 4), rng) for k in NODES for _ in range(2)]
    return [write_uff(folder / f"{i}.uff", [one]) for i, one in enumerate(every)]


def named_columns(folder, rng):
    told = "hit: +z", "hit_point: n{}"
    for k in NODES:
        own = [text.format(PLATE.nodes[k]) for text in told]
        write_csv(folder / f"{k}.csv", tap(PLATE, k, (0, 5), rng), "acceleration_{}_z_m_s2", *own)
    return [folder]


def table(folder, rng):
    """Points that recordings.csv alone tells."""
    rows = ["pose,hit,hit_point,response_points,repeat,file"]
    for k in NODES:
        write_csv(folder / f"{k}.csv", tap(PLATE, k, (0,), rng), "acceleration_z_m_s2")
        rows.append(f"P1,+z,{PLATE.nodes[k]},{PLATE.nodes[0]},1,{k}.csv")
    (folder / "recordings.csv").write_text("\n".join(rows) + "\n")
    return [folder]


@pytest.mark.parametrize(
    "write", [roving_hammer, roving_sensor, one_file, repeats, named_columns, table]
)
def test_hits_of_any_points(write, tmp_path):
    paths = write(tmp_path, np.random.default_rng(4))
    answer = only_told("modes", *paths, "--band-hz", *BAND)
    assert len(answer["dofs"]) == len(NODES)
    assert answer["simulated"] == (write not in (named_columns, table))
    assert answer["refused"] == []
    agree(answer, PLATE, BAND, *NEAR, least=0.99)


@pytest.mark.parametrize(
    ("column", "attributes", "dof", "scaled"),
    [
        ("acceleration_z_m_s2", ("hit: +z",), ["", "z"], True),
        ("acceleration_z_m_s2", ("hit: +x",), ["", "z"], False),
        ("acceleration_z_m_s2", (), ["", "z"], False),
        ("acceleration_m_s2", ("hit: +z",), ["acceleration_m_s2", "scalar"], False),
        ("acceleration_m_s2", (), ["acceleration_m_s2", "scalar"], False),
    ],
)
def test_a_hammer_and_one_sensor(column, attributes, dof, scaled, tmp_path):
    """Without a band: where the hit excites; what is not stated is not made up."""
    path = write_csv(tmp_path / "tap.csv", tap(PLATE, 0, (0,), np.random.default_rng(2)), column,
                     *attributes)  # fmt: skip
    answer = only_told("modes", path)
    assert answer["dofs"] == [dof]
    assert BAND[1] < answer["band_hz"][1] < 512
    assert {mode["scaled"] for mode in answer["modes"]} == {scaled}
    agree(answer, PLATE, BAND, *NEAR, least=None)


def test_an_analysers_window_is_taken_out_of_the_damping(tmp_path):
    rng, rate = np.random.default_rng(3), 3.0
    one = tap(PLATE, 0, (0,), rng)
    window = np.exp(-rate * np.maximum(0, np.arange(one.force_n.size) / 1024.0 - 0.102))
    one.acceleration_m_s2[:] *= window
    one.force_n[:] *= window
    path = write_csv(tmp_path / "tap.csv", one, "acceleration_z_m_s2", "hit: +z")
    answer = told("modes", path, "--window-rate", rate)
    agree(answer, PLATE, BAND, *NEAR, least=None)


def test_faulty_hits_are_refused_and_the_others_used(tmp_path):
    rng = np.random.default_rng(6)
    paths = roving_hammer(tmp_path, rng)
    double = write_uff(tmp_path / "double.uff", [tap(PLATE, 3, (0,), rng, second=0.6)])
    run_of = [tap(PLATE, 5, (0,), rng, second=share) for share in (0.0, 0.5)]
    run_of = write_uff(tmp_path / "run.uff", run_of)
    code, answer, _ = modes(*paths, double, run_of, "--band-hz", *BAND)
    assert code == 3
    assert [one["file"] for one in answer["refused"]] == [str(double), f"{run_of} (hit 2)"]
    assert all("second pulse" in one["reason"] for one in answer["refused"])
    agree(answer, PLATE, BAND, *NEAR, least=0.99)
    assert "second pulse" in refused("modes", double, "--json", code=3)


def test_pictures_and_files_of_taps(tmp_path):
    paths = roving_hammer(tmp_path, np.random.default_rng(7))
    options = "--plot", tmp_path / "plots", "--export", tmp_path / "out", "--band-hz", *BAND
    answer = only_told("modes", *paths, *options)
    assert all(Path(path).read_bytes().startswith(b"\x89PNG") for path in answer["plots"])
    again = told("modes", tmp_path / "out" / "frfs.uff", "--band-hz", *BAND)
    assert again["dofs"] == answer["dofs"]


def test_a_record_sampled_too_slowly_for_the_band_names_both(tmp_path):
    one = tap(PLATE, 0, (0,), np.random.default_rng(2))
    path = write_csv(tmp_path / "tap.csv", one, "acceleration_z_m_s2", "hit: +z")
    err = refused("modes", path, "--band-hz", 600, 900, code=3)
    assert "its FRFs end at 460.8 Hz, before the end of the band of 600 to 900 Hz" in err
    assert "--band-hz" in err


def test_what_readers_notice_of_hits_is_told(tmp_path):
    """Channels that begin apart, of no known unit; a pulse that not all channels have."""
    one = tap(PLATE, 0, (0,), np.random.default_rng(6))
    write_csv(tmp_path / "tap.csv", one, "acceleration_z_m_s2", "hit: +z")
    rows = np.loadtxt(tmp_path / "tap.csv", delimiter=",", comments="#", skiprows=2)
    head = "# hit: +z\nTime (s),force_n,Time (s),acceleration_z_m_s2,other"

    def written(late):
        both = np.column_stack([rows[:-late, :2], rows[late:][:, [0, 2, 2]]])
        np.savetxt(tmp_path / "late.csv", both, delimiter=",", header=head, comments="")
        return tmp_path / "late.csv"

    late = round(0.01 / (rows[1, 0] - rows[0, 0]))
    answer = only_told("modes", written(late))
    assert any("acceleration_z_m_s2 begin" in text for text in answer["remarks"])
    assert any("unit is not known: other." in text for text in answer["remarks"])
    assert "s apart" in refused("modes", written(len(rows) // 2), code=3)


def test_short_records_of_one_sensor_give_modes_or_a_sentence(tmp_path):
    one = tap(PLATE, 0, (0,), np.random.default_rng(2))
    for kept in (120, 160, 180, 200, 220, 260, 300, 340, 380, 420):
        cut = replace(
            one, force_n=one.force_n[:kept], acceleration_m_s2=one.acceleration_m_s2[:, :kept]
        )
        path = write_csv(tmp_path / f"{kept}.csv", cut, "acceleration_z_m_s2", "hit: +z")
        code, _, err = modes(path)
        assert code in (0, 3), (kept, err)
        assert code == 0 or err.startswith(
            ("No mode could be found", "No modes could be identified")
        )
