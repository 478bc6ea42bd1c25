"""One small campaign that all tests of what is handed on share."""

import pytest

from planner.campaign.campaign import Campaign
from tests.support.named_campaign import named_campaign


@pytest.fixture(scope="package")
def named(tmp_path_factory) -> Campaign:
    """Two measured poses with unpleasant names."""
    return named_campaign(tmp_path_factory.mktemp("named"))
