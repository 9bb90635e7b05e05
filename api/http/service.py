"""The service as a whole, and its port."""

import ipaddress
import os
import socket
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import uvicorn
from fastapi import APIRouter, FastAPI
from starlette.middleware import Middleware
from starlette.middleware.body_limit import RequestBodyLimitMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware

from api.fitting import warm
from api.http import acquisitions, errors, login, pages, runs, samples, series
from api.http.assets import Assets
from api.http.bench import Bench
from api.http.guard import MOST_BYTES, Guard, Outermost, Token
from api.http.links import API
from api.http.shared import Service
from api.http.traces import Traces
from daq.catalog import Catalog
from daq.errors import DaqError
from daq.store import Store

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")


class ServeError(DaqError):
    """The service cannot be started as asked."""


def create_app(
    data: Path, rig: Path | None = None, *, hosts: Sequence[str] = LOOPBACK, token: str | None = None
) -> FastAPI:
    """The application over the data folder, with a bench if a rig file is given.

    hosts : what a request's Host header may name; token : what every request must bear, None for no token.

    Raises
    ------
    SettingsError : the rig file is wrong.
    """
    key = None if token is None else Token(token)
    app = FastAPI(
        title="droptower",
        description="Runs of an instrumented drop tower: samples, findings with uncertainties, and the rig.",
        version=version("droptower"),
        openapi_url=f"{API}/openapi.json",
        docs_url=None,  # the default pages load a CDN, which a bench without internet has not
        redoc_url=None,
        middleware=[
            Middleware(Outermost),
            Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts), www_redirect=False),
            Middleware(Guard, token=key),
            Middleware(
                RequestBodyLimitMiddleware, max_body_size=MOST_BYTES
            ),  # for a body that does not tell its length
        ],
    )
    store = Store(data)
    bench = None if rig is None else Bench(rig, data)
    app.state.service = Service(store, Catalog(store), Traces(store), bench)
    app.state.token = key
    errors.install(app)
    api = APIRouter(prefix=API, responses={"default": {"model": errors.ErrorBody}})
    for part in (runs, samples, series, acquisitions):
        api.include_router(part.router)
    app.include_router(api)
    app.include_router(pages.router)
    app.include_router(login.router)
    app.mount("/static", Assets(), name="static")
    return app


def serve(data: Path, rig: Path | None, host: str, port: int, on_ready: Callable[[str], None]) -> None:
    """Serve until SIGINT or SIGTERM; `on_ready` is told the address once it answers.

    Raises
    ------
    ServeError : an address that others reach without token and named hosts, or a port that cannot be had.
    SettingsError : the rig file is wrong.
    """
    warm()
    token, hosts = _admission(host)
    app = create_app(data, rig, hosts=hosts, token=token)
    listener = _bound(host, port)
    shown = f"[{host}]" if ":" in host else host
    url = f"http://{shown}:{listener.getsockname()[1]}/"
    config = uvicorn.Config(
        app, access_log=False, log_config=None, lifespan="off", server_header=False, timeout_graceful_shutdown=3
    )
    try:
        _Server(config, lambda: on_ready(url)).run([listener])
    except KeyboardInterrupt:
        pass  # uvicorn has shut down in order and then hands the signal on
    finally:
        listener.close()


class _Server(uvicorn.Server):
    """Tells when it is ready, and its open event streams when it stops."""

    def __init__(self, config: uvicorn.Config, on_ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._on_ready = on_ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._on_ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        app = self.config.app
        assert isinstance(app, FastAPI), "it was configured with one"
        app.state.service.closing = True
        await super().shutdown(sockets)


def _admission(host: str) -> tuple[str | None, Sequence[str]]:
    """Token and host names of the environment. Without them a service is for this computer alone."""
    token = os.environ.get("DROPTOWER_TOKEN") or None
    named = [h.strip() for h in os.environ.get("DROPTOWER_HOSTS", "").split(",") if h.strip()]
    if not _is_loopback(host):
        if token is None or not named or "*" in named:
            raise ServeError(
                f"--host {host} lets others reach this service. Set DROPTOWER_TOKEN to a long secret, and "
                f"DROPTOWER_HOSTS to the names they reach it by (as bench-pc,192.168.0.7); or leave --host out"
            )
        if len(token) < 16:
            raise ServeError(f"DROPTOWER_TOKEN has {len(token)} characters; take 16 or more")
    return token, [*LOOPBACK, *named]


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _bound(host: str, port: int) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind)
    except (OSError, OverflowError) as e:
        raise ServeError(f"--host {host} --port {port} is no address of this computer: {e}") from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(128)
    except OSError as e:
        listener.close()
        raise ServeError(
            f"port {port} on {host} cannot be had: {e.strerror or e}; end what holds it or give another by --port"
        ) from None
    return listener
