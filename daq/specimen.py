"""A specimen is hit once."""

import tomllib

from daq.catalog import Catalog
from daq.errors import AcquisitionError
from daq.store import Store


def refuse_used(store: Store, test_text: str) -> None:
    """A specimen is hit once: an id that a run has already is asked about. One that the file does not give is not.

    Raises
    ------
    AcquisitionError : `specimen`; names the run.
    """
    specimen = tomllib.loads(test_text).get("specimen", {}).get("id")
    if specimen is None or not store.folder.is_dir():
        return
    if earlier := Catalog(store).runs({"specimen": specimen}, limit=1):
        raise AcquisitionError(
            "specimen",
            f"specimen {specimen!r} was hit before, in run {earlier[0].run}; give the new one another id, "
            f"or ask for it with --again",
        )
