import pytest
from starlette.testclient import TestClient

from gapwalk.explorer.web_app import MAX_BODY, application, is_loopback, kept_token
from tests.explorer.conftest import ORIGIN

JSON = {"content-type": "application/json"}


@pytest.mark.parametrize(
    "host",
    [
        "127.0.0.1",
        "127.0.0.1:8000",
        "127.8.9.10:1",
        "localhost:1",
        "LocalHost",
        "localhost.:80",
        "127.0.0.1.:80",
        "[::1]:80",
        "[::1]",
        "[0:0:0:0:0:0:0:1]:8000",
        "localhost:",
    ],
)
def test_this_machine_is_answered(client, host) -> None:
    assert client.get("/api/files", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "host",
    [
        *("evil.example", "evil.example:8000", "127.0.0.1.evil.example", "", "10.0.0.1", "0.0.0.0"),
        *("localhost.evil.example", "evil-localhost", "evil.example#localhost", "evil.example:80@localhost"),
        *("[::1]evil.example", "[::1].evil.example:80", "[::1", "::1", "[127.0.0.1]", "[::]", "[::2]:80", "[evil]"),
        *(
            "localhost:80:80",
            "localhost:x",
            "localhost..",
            "localhost:100000000",
            "127.0.0.1:80/evil",
            ".localhost",
            ".",
        ),
    ],
)
def test_a_foreign_name_that_points_here_is_not_answered(client, host) -> None:
    answer = client.get("/api/files", headers={"host": host})
    assert answer.status_code == 421
    assert "127.0.0.1" in answer.text


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://localhost"])
def test_a_page_of_another_origin_is_not_answered(client, origin) -> None:
    for ask in (client.get, client.post):
        assert ask("/api/files", headers={"origin": origin, **JSON}).status_code == 403
    assert client.get("/api/files", headers={"sec-fetch-site": "cross-site"}).status_code == 403
    assert client.get("/api/files", headers={"origin": ORIGIN, "sec-fetch-site": "same-origin"}).status_code == 200


def test_a_form_cannot_do_anything(client, model) -> None:
    answer = client.post("/api/act", content="{}", headers={"content-type": "text/plain"})
    assert answer.status_code == 415
    assert client.put("/api/act", json={}).status_code == 405


def test_large_requests_are_refused(client, model) -> None:
    assert client.post("/api/act", content=b" " * (MAX_BODY + 1), headers=JSON).status_code == 413

    def pieces():  # without a length
        for _ in range(80):
            yield b" " * 1000

    assert client.post("/api/act", content=pieces(), headers=JSON).status_code == 413
    many = {"file": model, "do": "compute", "values": {f"p{i}": 1.0 for i in range(1001)}}
    assert client.post("/api/act", json=many).status_code == 400
    assert client.get("/api/about", params={"file": "x" * 500}).status_code == 400
    assert client.post("/api/act", content=b"[" * 60000, headers=JSON).status_code == 400


def test_beyond_this_machine_a_token_is_needed(session) -> None:
    client = TestClient(application(session, token="secret", is_local=False), base_url="http://box.example")
    assert client.get("/api/files").status_code == 403
    assert client.get("/?token=wrong").status_code == 403
    page = client.get("/?token=secret")
    assert page.status_code == 200
    assert "HttpOnly" in page.headers["set-cookie"]
    assert "SameSite=Strict" in page.headers["set-cookie"]
    assert client.get("/api/files").status_code == 200  # by the cookie
    assert client.get("/api/files", headers={"origin": "http://evil.example"}).status_code == 403


def test_on_this_machine_too_a_token_is_needed(session) -> None:
    """Other users of a machine reach its loopback address."""
    client = TestClient(application(session, token="secret"), base_url=ORIGIN)
    for path in ("/", "/api/files", "/api/about?file=stop.toml", "/static/main.js", "/api/events"):
        assert client.get(path).status_code == 403, path
    assert client.post("/api/act", json={"file": "stop.toml", "do": "compute"}).status_code == 403
    assert (
        client.get("/api/files", headers={"host": "evil.example", "cookie": "gapwalk-token=secret"}).status_code == 421
    )
    assert client.get("/?token=secret").status_code == 200
    assert client.get("/api/files").status_code == 200


def test_two_explorers_of_one_machine_keep_their_cookies(session) -> None:
    """Browsers send the cookies of an address to all of its ports."""
    both = [TestClient(application(session, token=each), base_url=ORIGIN) for each in ("one", "other")]
    for client, token in zip(both, ("one", "other"), strict=True):
        client.cookies = both[0].cookies
        assert client.get(f"/?token={token}").status_code == 200
    assert [client.get("/api/files").status_code for client in both] == [200, 200]


def test_the_token_of_the_command_line_of_the_browser_works_once(session) -> None:
    guarded = application(session, token="secret", once="opened")
    first, other = (TestClient(guarded, base_url=ORIGIN) for _ in range(2))
    assert first.get("/?token=opened").status_code == 200
    assert first.get("/?token=opened").status_code == 200  # the page is reloaded: its cookie counts
    assert other.get("/?token=opened").status_code == 403
    assert other.get("/?token=").status_code == 403


def test_a_token_is_kept_for_a_restart_where_only_this_user_reads_it(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    token = kept_token(tmp_path, 8000)
    assert kept_token(tmp_path, 8000) == token
    assert len({token, kept_token(tmp_path, 8001), kept_token(tmp_path / "other", 8000)}) == 3
    (secret,) = (tmp_path / "gapwalk" / "explorer").iterdir()
    assert secret.stat().st_mode & 0o777 == 0o600
    secret.chmod(0o644)  # somebody may have read it
    assert kept_token(tmp_path, 8000) != token
    assert secret.stat().st_mode & 0o777 == 0o600
    secret.parent.chmod(0o777)
    assert kept_token(tmp_path, 8000) != kept_token(tmp_path, 8000)


@pytest.mark.parametrize(
    ("host", "inside"),
    [("127.0.0.1", True), ("127.1.2.3", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("box", False)],
)
def test_what_counts_as_this_machine(host, inside) -> None:
    assert is_loopback(host) is inside
