"""Acting in a campaign: alone, on the log as it is now."""

from typing import TYPE_CHECKING

from planner.campaign import store
from planner.campaign.journal import remove_parts

if TYPE_CHECKING:
    from planner.campaign.campaign import Campaign


class Acting:
    """The campaign's lock, its log read afresh and its configuration followed."""

    def __init__(self, campaign: "Campaign"):
        self._campaign = campaign
        self._lock = campaign._journal.writing()

    def __enter__(self) -> None:
        self._lock.__enter__()
        remove_parts(self._campaign.directory / store.RECORDINGS)
        try:
            self._campaign._log_configuration()
        except BaseException:
            self._lock.__exit__(None, None, None)
            raise

    def __exit__(self, *error: object) -> None:
        self._lock.__exit__(None, None, None)
