"""Static files: our own, and those that installed packages carry; nothing is copied here or loaded from elsewhere."""

import os
from importlib.util import find_spec
from pathlib import Path

from fastapi.staticfiles import StaticFiles

from api.http.rendering import FOLDER
from daq.errors import DaqError

PACKAGED = {
    "plotly.min.js": ("plotly", "package_data/plotly.min.js"),
    "swagger-ui-bundle.js": ("fastapi_offline", "static/swagger-ui-bundle.js"),
    "swagger-ui.css": ("fastapi_offline", "static/swagger-ui.css"),
}
"""Name under /static/ by package and path in it."""


class MissingAsset(DaqError):
    """An installed package does not carry what the pages need."""


def packaged(name: str) -> Path:
    """Where an installed package keeps the file, found without importing it: plotly takes a second to import.

    Raises
    ------
    MissingAsset : the package is not there, or is laid out otherwise.
    """
    package, inside = PACKAGED[name]
    spec = find_spec(package)
    for folder in (spec.submodule_search_locations or []) if spec is not None else []:
        if (path := Path(folder) / inside).is_file():
            return path
    raise MissingAsset(f"package {package} has no {inside}; run `make setup` again")


class Assets(StaticFiles):
    """Files of `api/static`, and those of PACKAGED beside them."""

    def __init__(self) -> None:
        super().__init__(directory=FOLDER / "static")
        self._packaged = {name: str(packaged(name)) for name in PACKAGED}

    def lookup_path(self, path: str) -> tuple[str, os.stat_result | None]:
        if (found := self._packaged.get(path)) is not None:
            return found, Path(found).stat()
        return super().lookup_path(path)
