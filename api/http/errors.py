"""How anything that goes wrong is answered: one JSON form, one place where an error gets its status, no traceback."""

import re
from collections.abc import Mapping
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from api.http.rendering import page
from daq.errors import (
    AcquisitionError,
    DaqError,
    DeviceError,
    ImportFileError,
    LinkError,
    RigBusy,
    RunNotFound,
    SeriesNotFound,
    SettingsError,
    StoreError,
)

STATUS: dict[type[DaqError], int] = {
    RunNotFound: 404,
    SeriesNotFound: 404,
    SettingsError: 422,
    ImportFileError: 422,
    StoreError: 503,
    RigBusy: 409,
    AcquisitionError: 409,
    LinkError: 502,
    DeviceError: 502,
    DaqError: 500,
}


class Problem(BaseModel):
    """What went wrong, for a program (`code`) and for a person (`text`)."""

    code: str
    text: str


class ErrorBody(BaseModel):
    """The body of every answer that is not a success."""

    error: Problem


class Refusal(Exception):
    """A request that is not answered as asked; `text` names the limit and the way out."""

    def __init__(self, status: int, code: str, text: str, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(text)
        self.status, self.code, self.text, self.headers = status, code, text, headers


def problem(request: Request, status: int, code: str, text: str, headers: Mapping[str, str] | None = None) -> Response:
    """An error as JSON to programs, as a page to people."""
    path = request.url.path
    if not path.startswith("/api/") and "text/html" in request.headers.get("accept", ""):
        return page(request, "error.html", status=status, headers=headers, code=code, text=text)
    body = ErrorBody(error=Problem(code=code, text=text)).model_dump()
    return JSONResponse(body, status, headers=dict(headers or {}))


def install(app: FastAPI) -> None:
    """Make the application answer every error in this form."""
    app.add_exception_handler(DaqError, _daq_error)
    app.add_exception_handler(Refusal, _refusal)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(RequestValidationError, _wrong_request)


def _daq_error(request: Request, error: Exception) -> Response:
    status = next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)
    code = error.outcome if isinstance(error, AcquisitionError) else _kebab(type(error).__name__)
    return problem(request, status, code, str(error))


def _refusal(request: Request, error: Exception) -> Response:
    assert isinstance(error, Refusal), "it is installed for this type"
    return problem(request, error.status, error.code, error.text, error.headers)


def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException), "it is installed for this type"
    words = {
        404: f"nothing is at {request.url.path}; the API starts at /api/v1/runs and is described at /docs",
        405: f"{request.url.path} does not take {request.method}",
    }
    code = {404: "not-found", 405: "method-not-allowed"}.get(error.status_code, "refused")
    text = words.get(error.status_code, str(error.detail))
    return problem(request, error.status_code, code, text, error.headers)


def _wrong_request(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError), "it is installed for this type"
    return problem(request, 422, "wrong-request", "; ".join(_complaint(d) for d in error.errors()))


def _complaint(detail: Mapping[str, Any]) -> str:
    where, *names = [str(part) for part in detail["loc"]]
    given = detail.get("input")
    shown = f" (given: {given!r})" if isinstance(given, str | int | float) else ""
    message = detail["msg"][:1].lower() + detail["msg"][1:]
    return f"{where} {'.'.join(names)}: {message}{shown}".replace(" :", ":")


def _kebab(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "-", name).lower()
