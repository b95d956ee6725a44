import json
import os

import pytest

from gapwalk.errors import ModelError, StoreError
from gapwalk.explorer.workspace import Workspace, read_records, write_record


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    root = tmp_path / "workspace"
    root.mkdir()
    (root / "a.toml").write_text("")
    (tmp_path / "secret.toml").write_text("")
    return Workspace(root)


def test_files_of_the_workspace_are_listed(workspace) -> None:
    for name in ("b.gapwalk", ".hidden.toml", "notes.txt"):
        (workspace.root / name).write_text("")
    assert workspace.files() == ["a.toml", "b.gapwalk"]


@pytest.mark.parametrize(
    "name",
    ["../secret.toml", "/etc/passwd", "a.toml/../../secret.toml", ".hidden.toml", ".x/a.toml", "", "a\0.toml", "a.txt"],
)
def test_nothing_else_can_be_reached(workspace, name) -> None:
    with pytest.raises(ModelError):
        workspace.path(name)


def test_a_link_that_leads_out_is_not_followed(workspace) -> None:
    os.symlink(workspace.root.parent / "secret.toml", workspace.root / "link.toml")
    with pytest.raises(ModelError, match="outside"):
        workspace.path("link.toml")
    os.symlink(workspace.root.parent, workspace.root / "a.explorer")
    with pytest.raises(StoreError, match="leads out"):
        workspace.claim(workspace.path("a.toml"), "walk")


def test_the_server_refuses_paths_outside(client) -> None:
    for name in ("../../etc/passwd", "/etc/passwd", "..%2f..%2fetc%2fpasswd"):
        answer = client.get("/api/about", params={"file": name})
        assert answer.status_code == 400
    assert client.get("/static/../app.py").status_code == 404
    assert client.get("/static/%2e%2e/app.py").status_code == 404


def test_names_are_given_once_only(workspace) -> None:
    other = Workspace(workspace.root)  # as a second server would have it
    claimed = [each.claim(workspace.path("a.toml"), "walk").name for each in (workspace, other, workspace)]
    assert claimed == ["01-walk.gapwalk", "02-walk.gapwalk", "03-walk.gapwalk"]


def test_records_are_read_back_and_nonsense_is_left_out(workspace) -> None:
    output = workspace.claim(workspace.path("a.toml"), "walk")
    write_record(output, {"title": "first"})
    (output.parent / "02-x.json").write_text("{")
    (output.parent / "03-x.json").write_text(json.dumps([1]))
    (output.parent / "04-x.json").write_text(" " * 200_000)
    assert read_records(output.parent) == {output: {"title": "first"}}
