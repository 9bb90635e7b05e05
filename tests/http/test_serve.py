"""The service as a process: its port, its one line, its end."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx2
import pytest
from rigs import write_rig

from api.http.service import ServeError, serve
from daq.errors import DaqError, SettingsError

PROGRAM = """
import sys
from pathlib import Path
from api.http.service import serve
serve(Path(sys.argv[1]), None, "127.0.0.1", 0, lambda url: print(url, file=sys.stderr, flush=True))
"""


def refuse(url: str) -> None:
    raise AssertionError(f"it serves at {url}")


@pytest.fixture(autouse=True)
def no_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DROPTOWER_TOKEN", "DROPTOWER_HOSTS"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.0.7", "bench-pc"])
@pytest.mark.parametrize(
    "given", [{}, {"DROPTOWER_TOKEN": "a-long-secret-of-the-bench"}, {"DROPTOWER_HOSTS": "bench-pc"}]
)
def test_others_reach_it_by_token_and_named_hosts_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, host: str, given: dict[str, str]
) -> None:
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(ServeError, match=r"(?s)DROPTOWER_TOKEN.*DROPTOWER_HOSTS"):
        serve(tmp_path, None, host, 0, refuse)


@pytest.mark.parametrize(("token", "hosts"), [("short", "bench-pc"), ("a-long-secret-of-the-bench", "*")])
def test_a_weak_token_or_any_host_will_not_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, token: str, hosts: str
) -> None:
    monkeypatch.setenv("DROPTOWER_TOKEN", token)
    monkeypatch.setenv("DROPTOWER_HOSTS", hosts)
    with pytest.raises(ServeError, match="DROPTOWER_TOKEN"):
        serve(tmp_path, None, "0.0.0.0", 0, refuse)


def test_a_taken_port_is_one_message(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as holder:
        port = holder.getsockname()[1]
        with pytest.raises(ServeError, match=rf"port {port} .*--port"):
            serve(tmp_path, None, "127.0.0.1", port, refuse)


def test_a_wrong_rig_file_is_told_before_anything_is_served(tmp_path: Path) -> None:
    rig = write_rig(tmp_path, "socket://127.0.0.1:1", "scpi")
    rig.write_text(rig.read_text().replace("samples =", "sample ="))
    with pytest.raises(SettingsError, match="samples"):
        serve(tmp_path, rig, "127.0.0.1", 0, refuse)
    with pytest.raises(DaqError, match="no such file"):
        serve(tmp_path, tmp_path / "none.toml", "127.0.0.1", 0, refuse)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_says_where_it_is_and_ends_when_told(tmp_path: Path, number: signal.Signals) -> None:
    command = [sys.executable, "-W", "error", "-c", PROGRAM, str(tmp_path)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env={**os.environ}) as process:
        assert process.stderr is not None
        url = process.stderr.readline().strip()
        assert httpx2.get(f"{url}api/v1/runs").json()["runs"] == []
        started = time.monotonic()
        process.send_signal(number)
        assert process.stderr.read() == "", "one line, and no more"
        assert time.monotonic() - started < 5
    assert process.returncode in (0, -number)
