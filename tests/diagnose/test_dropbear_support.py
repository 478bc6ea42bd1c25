"""A real beam whose roller is not where its model has it: the support is what differs.

Real recordings (DROPBEAR), responses only: first modes from ring-downs of the dwells. What a volt
of the pin means in metres is taken from two other recordings.
"""

import numpy as np
import pytest

from planner.diagnosis.effects.effect import Quantity
from planner.recording.read import read
from tests.support.beam import first_hz
from tests.support.decays import ringdown
from tests.support.dropbear import FIRST_MODE, dwells
from tests.support.frequency_changes import Change, explain

pytestmark = pytest.mark.slow

STATIONS = tuple(FIRST_MODE)  # V
SD_HZ = 0.1  # scatter of the ring-downs, and of a beam without its fittings
POSITION = 0.03  # m: sd of where a support may be instead
BEAM = (Quantity("modulus", "1", 0.0, 0.01, logarithmic=True),)


def recorded(shared_data, number):
    """Of every dwell: station (V) and first mode (Hz)."""
    (record,) = read(shared_data / "dropbear" / f"slow10_test{number}.txt.gz")
    acceleration, _, pin = (channel.samples for channel in record.channels[:3])
    out = []
    for dwell in dwells(pin, record.sampling_rate_hz):
        volts = float(np.median(pin[dwell]))
        station = min(STATIONS, key=lambda v: abs(v - volts))
        if abs(station - volts) < 0.05:
            decays = ringdown(acceleration[dwell], record.sampling_rate_hz, (15.0, 60.0))
            out.append((station, decays[0].frequency_hz))
    return out


@pytest.fixture(scope="module")
def metres(shared_data):
    """Roller's distance from the clamp in m by volts, from the stations of two recordings."""
    grid = np.linspace(0.02, 0.3, 400)
    table = np.array([first_hz(x) for x in grid])
    seen = [pair for number in (0, 1) for pair in recorded(shared_data, number)]
    places = [np.interp(hertz, table, grid) for _, hertz in seen]
    return np.polynomial.Polynomial.fit([v for v, _ in seen], places, 1)


def changes():
    """What could differ: each station's support, the beam, its end, its clamp."""
    stations = [
        Change("support_position", f"{v} V", Quantity(f"shift at {v} V", "m", 0.0, POSITION))
        for v in STATIONS
    ]
    return (
        *stations,
        Change("support_position", "all", Quantity("shift", "m", 0.0, POSITION)),
        Change("added_mass", "tip", Quantity("mass", "kg", np.log(0.05), 1.0, logarithmic=True)),
        Change(
            "clamp_compliance",
            "clamp",
            Quantity("give", "rad/(N·m)", np.log(5e-5), 1.5, logarithmic=True),
        ),
    )


def model_of(seen, stated):
    """Frequencies of the dwells; `stated` (m) is where the model has the roller at each."""

    def model(values):
        clamp = 1 / values["give"] if values["give"] else np.inf
        beam = {"modulus": values["modulus"], "tip_kg": values["mass"], "clamp_n_m_rad": clamp}
        by_station = {
            v: first_hz(stated[v] + values["shift"] + values[f"shift at {v} V"], **beam)
            for v in {station for station, _ in seen}
        }
        return np.array([[by_station[station]] for station, _ in seen])

    return model


@pytest.mark.parametrize("number", [2, 3, 4])
def test_where_all_positions_are_known_nothing_differs(shared_data, metres, number):
    seen = recorded(shared_data, number)
    hertz = np.array([[f] for _, f in seen])
    model = model_of(seen, {v: metres(v) for v in STATIONS})
    found = explain(hertz, np.full(hertz.shape, SD_HZ), model, BEAM, changes())
    best = found.explanations[0]
    print(f"\ntest {number}: {found.verdict}, {best.probability:.3f}")
    assert found.verdict == "consistent"


@pytest.mark.parametrize("number", [2, 4])
@pytest.mark.parametrize("withheld", STATIONS)
def test_a_withheld_position_is_named_and_estimated(shared_data, metres, number, withheld):
    seen = recorded(shared_data, number)
    hertz = np.array([[f] for _, f in seen])
    for wrong in [0.02]:
        stated = {v: metres(v) + wrong * (v == withheld) for v in STATIONS}
        model = model_of(seen, stated)
        found = explain(hertz, np.full(hertz.shape, SD_HZ), model, BEAM, changes())
        best = found.explanations[0]
        shift, sd, _ = best.values.get(f"shift at {withheld} V", (np.nan, np.nan, ""))
        print(
            f"\ntest {number}, {withheld} V: {[(c.effect, c.at) for c in best.changes]} "
            f"{best.probability:.3f}, at {1e3 * (stated[withheld] + shift):.1f} ± {1e3 * sd:.1f} "
            f"mm, pin {1e3 * metres(withheld):.1f} mm"
        )
        assert found.verdict == "explained"
        assert [(c.effect, c.at) for c in best.changes] == [("support_position", f"{withheld} V")]
        assert abs(stated[withheld] + shift - metres(withheld)) < 0.002
