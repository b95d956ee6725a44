// Small helpers of the pages: fill a select, save a file.

/** Fill a select with values, texts, and whole names, which are shown where the box is too narrow for them. */
export function fill(select, pairs) {
  select.replaceChildren(...pairs.map(([value, text, title = text]) => Object.assign(new Option(text, value), { title })));
}

/** The unit at the end of a title, as in " [rpm]"; empty for a plain number. */
export function unitOf(words) {
  return / \[[^\]]*\]$/.exec(words)?.[0] ?? "";
}

/** A name that is broken at its dots and underscores where it is too long for a line. */
export function breakable(words) {
  return words.split(/(?<=[._])/).flatMap((part) => [part, document.createElement("wbr")]);
}

/** The title of the axis of a signal, with its unit, as the list of signals has it. */
export function signalWords(name) {
  return [...document.getElementById("signal").options].find(({ value }) => value === name)?.text ?? name;
}

/** Have the browser save something. */
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
