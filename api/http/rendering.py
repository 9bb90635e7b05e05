"""Pages from templates, JSON that is JSON."""

import math
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from fastapi import Request
from fastapi.responses import Response
from fastapi.templating import Jinja2Templates
from numpy.typing import NDArray

FOLDER = Path(__file__).parent.parent
_templates = Jinja2Templates(directory=FOLDER / "templates")
_templates.env.trim_blocks = _templates.env.lstrip_blocks = True


def page(
    request: Request, template: str, *, status: int = 200, headers: Mapping[str, str] | None = None, **values: Any
) -> Response:
    """A page of `api/templates`."""
    values["version"] = version("droptower")
    return _templates.TemplateResponse(request, template, values, status, dict(headers or {}))


def numbers(values: NDArray[np.float64]) -> list[float | None]:
    """An array for JSON; what is not finite is null."""
    if np.isfinite(values).all():
        return values.tolist()
    return [v if math.isfinite(v) else None for v in values.tolist()]


def plain(tree: Any) -> Any:
    """A tree for JSON; what is not finite is null."""
    if isinstance(tree, dict):
        return {k: plain(v) for k, v in tree.items()}
    if isinstance(tree, list | tuple):
        return [plain(v) for v in tree]
    return None if isinstance(tree, float) and not math.isfinite(tree) else tree
