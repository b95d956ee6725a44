import json
import os

import pytest

from gapwalk.errors import ModelError, StoreError
from gapwalk.explorer.workspace_folder import Workspace, read_records, write_record


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


def test_links_that_lead_out_are_not_listed(workspace) -> None:
    outside = workspace.root.parent / "elsewhere"
    outside.mkdir()
    for name in ("01-walk.gapwalk", "secret.toml", "secret.csv"):
        (outside / name).write_text("")
    (outside / "01-walk.json").write_text('{"title": "secret"}')
    for name in ("secret.toml", "secret.csv", "01-walk.gapwalk"):
        (workspace.root / name).symlink_to(outside / name)
    (workspace.root / "circle.toml").symlink_to("circle.toml")
    assert workspace.files() == ["a.toml"]
    assert workspace.records() == []
    with pytest.raises(ModelError, match="outside"):
        workspace.path("circle.toml")
    folder = workspace.exploration(workspace.path("a.toml"))
    folder.symlink_to(outside)
    assert read_records(folder, workspace) == {}
    folder.unlink()
    folder.mkdir()
    (folder / "01-walk.json").symlink_to(outside / "01-walk.json")
    (folder / "02-walk.json").write_text('{"title": "own"}')
    (folder / "02-walk.gapwalk").symlink_to(outside / "01-walk.gapwalk")
    assert read_records(folder, workspace) == {}


@pytest.mark.parametrize("spelt", ["./{}", "x/../{}", "{}/", "{}/.", ".//{}", "link.toml", "../{root}/{}"])
def test_one_file_has_one_name(client, session, model, spelt) -> None:
    """By a second name, a file would have a second list of results, and a second job in it."""
    link, root = session.workspace.root / "link.toml", session.workspace.root.name
    link.unlink(missing_ok=True)
    link.symlink_to(model)
    found = client.get("/api/about", params={"file": spelt.format(model, root=root)}).json()
    assert found["file"] == model
    assert session.exploration(spelt.format(model, root=root)) is session.exploration(model)
    listed = client.get("/api/files").json()["files"]
    assert listed.count(model) == 1
    assert "link.toml" not in listed


def test_a_file_is_not_found_by_a_name_in_other_capitals(workspace, monkeypatch) -> None:
    """Some file systems find it so."""
    monkeypatch.setattr(os, "listdir", lambda _: ["A.toml"])
    with pytest.raises(ModelError, match="spelt in another way"):
        workspace.path("a.toml")


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
    assert read_records(output.parent, workspace) == {output: {"title": "first"}}
