"""The addresses that the command prints and opens, and that a real server answers."""

import ipaddress
import os
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

from gapwalk.explorer import web_app as module
from tests.explorer.conftest import STOP
from tests.tiers import in_campaign
from tests.waiting import until


def status(address: str) -> int:
    try:
        with urllib.request.urlopen(address) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.parametrize("host", ["127.0.0.1", in_campaign("0.0.0.0"), in_campaign("0")])
def test_the_printed_addresses_can_be_opened_and_nothing_without_their_token(host, tmp_path) -> None:
    (tmp_path / "stop.toml").write_text(STOP)
    command = [sys.executable, "-m", "gapwalk", "explore", "stop.toml", "--host", host]
    opened = tmp_path / "opened"
    opener = tmp_path / "opener"
    opener.write_text(f'#!/bin/sh\necho "$1" > {opened}\n')
    opener.chmod(0o700)
    environment = {**os.environ, "BROWSER": str(opener), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path, env=environment) as server:
        assert server.stdout is not None
        lines = []
        while "Ctrl-C" not in (line := server.stdout.readline()):
            assert line
            lines.append(line.strip())
        assert str(tmp_path) in lines[0]
        try:
            for address in lines[1:]:
                found = re.fullmatch(r"http://([\d.]+):(\d+)/\?token=([\w-]{32})", address)
                assert found is not None, address
                assert not ipaddress.ip_address(found[1]).is_unspecified
                assert status(address) == 200
                assert status(address.replace("/?", "/api/files?")) == 200
                for bare in (address.partition("?")[0], f"http://{found[1]}:{found[2]}/api/files", f"{address}x"):
                    assert status(bare) == 403
            until(lambda: opened.exists() and opened.read_text(), "the browser is started")
            once = opened.read_text().strip()
            assert once not in lines  # the command line of a browser is no secret
            assert [status(once), status(once)] == [200, 403]
        finally:
            server.send_signal(signal.SIGINT)


@pytest.mark.parametrize(
    ("host", "bound", "last"), [("0.0.0.0", "0.0.0.0", "127.0.0.1"), ("::", "::", "::1"), ("box", "192.0.2.7", "box")]
)
def test_a_server_that_listens_everywhere_has_an_address_here(host, bound, last) -> None:
    found = module._reachable(host, bound)
    assert found[-1] == last
    assert 1 <= len(found) <= 2
    assert not {"0.0.0.0", "::"} & set(found)
