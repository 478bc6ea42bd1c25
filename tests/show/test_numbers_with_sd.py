"""Numbers with their sd, and a pose's FRF sheet where there is no coherence."""

import numpy as np
import pytest

from planner.frf.frf import Frf
from planner.report.campaign_plots import frf_sheet
from planner.report.text import with_sd


@pytest.mark.parametrize(
    ("value", "sd", "form", "said"),
    [
        (15.985, 0.0003, ".3f", "15.985 ± <0.001"),
        (15.985, 0.0006, ".3f", "15.985 ± 0.001"),
        (1.5, 0.0, ".2f", "1.50 ± 0.00"),  # stated to be exact
        (1.5, None, ".2f", "1.50 ± –"),
        (None, None, ".2f", "–"),
        (1.5, float("nan"), ".2f", "1.50 ± –"),
    ],
)
def test_an_sd_never_rounds_to_nothing(value, sd, form, said):
    assert with_sd(value, sd, form) == said


@pytest.mark.parametrize(("known", "rows"), [(True, 3), (False, 2)])
def test_coherence_is_drawn_where_it_is_known_and_the_ground_is_grey_above_the_modes(known, rows):
    hz = np.linspace(5.0, 50.0, 40)
    mean = np.ones((3, 3, 40)) * (1 + 1j)
    coherence = np.full((3, 3, 40), 0.9 if known else np.nan)
    frf = Frf(hz, mean, 0.1 * np.abs(mean), coherence, (1, 1, 1), (5.0, 50.0))
    figure = frf_sheet(hz, mean, 0.1 * np.abs(mean), frf, np.array([10.0, 20.0, np.nan]))
    assert len(figure.axes) == 3 * rows
    for panel in figure.axes:
        (grey,) = [patch for patch in panel.patches if patch.get_facecolor()[:3] == (0.92,) * 3]
        assert grey.get_x() == 20.0
        assert grey.get_x() + grey.get_width() == 50.0
