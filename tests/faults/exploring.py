"""A program that lets the explorer compute a study, or go on with it, so that it can be killed."""

import sys
import time
from pathlib import Path

from starlette.testclient import TestClient

from gapwalk.explorer.server_state import Session
from gapwalk.explorer.web_app import application
from tests.explorer.conftest import ORIGIN, STOP

MODEL = "model.toml"


def main(path: str) -> None:
    """Compute the study of a model beside the folder of its results; write how many points a page has been told."""
    root = Path(path).parents[1]
    model = root / MODEL
    if not model.exists():
        model.write_text(STOP.replace("to = 0.9", "to = 1.2"))
    desk = Session(root)
    client = TestClient(application(desk), base_url=ORIGIN)
    known = client.get("/api/about", params={"file": MODEL}).json()["results"]
    going = [each for each in known if each["can_resume"]]
    if going:
        key = going[0]["key"]
        client.post("/api/job/resume", json={"file": MODEL, "result": key})
    else:
        key = client.post("/api/act", json={"file": MODEL, "do": "compute"}).json()["key"]
    while True:
        (found,) = [each for each in _results(client) if each["key"] == key]
        if found["branches"]:
            print(found["branches"][0]["points"] - 1, flush=True)
        if found["state"] in ("done", "stopped", "failed"):
            break
        time.sleep(0.05)
    print("complete" if found["state"] == "done" else found["state"], flush=True)
    desk.close()


def _results(client: TestClient) -> list[dict]:
    return client.get("/api/about", params={"file": MODEL}).json()["results"]


if __name__ == "__main__":
    main(sys.argv[1])
