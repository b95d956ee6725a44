import pytest
from starlette.testclient import TestClient

from gapwalk.explorer.request_guard import MAX_BODY, is_loopback
from gapwalk.explorer.web_app import application
from tests.explorer.conftest import ORIGIN

JSON = {"content-type": "application/json"}


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:8000", "localhost:1", "[::1]:80"])
def test_this_machine_is_answered(client, host) -> None:
    assert client.get("/api/files", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "127.0.0.1.evil.example", "", "10.0.0.1", "0.0.0.0"]
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
    client = TestClient(application(session, token="secret"), base_url="http://box.example")
    assert client.get("/api/files").status_code == 403
    assert client.get("/?token=wrong").status_code == 403
    page = client.get("/?token=secret")
    assert page.status_code == 200
    assert "HttpOnly" in page.headers["set-cookie"]
    assert "SameSite=Strict" in page.headers["set-cookie"]
    assert client.get("/api/files").status_code == 200  # by the cookie
    assert client.get("/api/files", headers={"origin": "http://evil.example"}).status_code == 403


@pytest.mark.parametrize(
    ("host", "inside"),
    [("127.0.0.1", True), ("127.1.2.3", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("box", False)],
)
def test_what_counts_as_this_machine(host, inside) -> None:
    assert is_loopback(host) is inside
