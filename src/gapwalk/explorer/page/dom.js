// Small helpers of the pages: fill a select, save a file.

/** Fill a select with values, texts, and whole names, which are shown where the box is too narrow for them. */
export function fill(select, pairs) {
  select.replaceChildren(...pairs.map(([value, text, title = text]) => Object.assign(new Option(text, value), { title })));
}

/** Have the browser save something. */
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
