// What lies between the model editor and the rest of the page: the file that is shown, and what follows a save.

import { get } from "./api.js";
import { fill } from "./dom.js";
import { Editor } from "./editor.js";

const $ = (id) => document.getElementById(id);

/** Make the editor. `open(name)` shows a file, `compute()` begins its study, `redraw()` draws the diagram again. */
export function editing(page, { open, compute, redraw, tell }) {
  /** Show the results of the chosen file again. */
  const closed = () => {
    const name = $("file").value;
    document.body.classList.toggle("without-file", !name);
    if (!name) {
      const begin = Object.assign(document.createElement("button"), { type: "button", textContent: "New model" });
      begin.addEventListener("click", () => editor.choose().catch(tell));
      $("empty").replaceChildren("There is no model file in this folder yet. ", begin);
    } else if (page.about?.file !== name) open(name).catch(tell);
    else redraw();
  };
  /** Show a file that was saved; `isComputed`: begin its study at once. */
  const saved = async (name, isComputed) => {
    const { files } = await get("/api/files");
    fill($("file"), files.map((each) => [each, each]));
    $("file").value = name;
    document.body.classList.remove("without-file");
    if (!isComputed) return;
    await open(name);
    await compute();
  };
  const editor = new Editor({ saved, closed, files: () => [...$("file").options].map(({ value }) => value) });
  $("edit-open").addEventListener("click", () => {
    if (editor.isOpen) return editor.close();
    const name = $("file").value;
    $("error").hidden = true; // it is about the results
    (name.endsWith(".toml") ? editor.open(name) : editor.choose()).catch(tell);
  });
  return editor;
}
