// What was chosen on the diagram: where it lies in the results, and what it is called.

/** The choice of a node of a curve; `x` is the name of what the diagram is over. */
export function choiceAt({ curve, index }, x) {
  const node = curve.node[index], special = node < 0 ? curve.special[-1 - node] : null;
  const start = { result: curve.result, branch: curve.branch, ...(special ? { special: -1 - node } : { point: node }) };
  const at = `${x === "frequency" ? "Ω" : x.replace(/^measure:/, "")} = ${curve.x[index].toPrecision(8)}`;
  return { start, special, curve, index, title: `${curve.name}${special ? `, ${special.text}` : ""}, ${at}` };
}

/** Fill a select with values, texts, and whole names, which are told where the box is too narrow for them. */
export function fill(select, pairs) {
  select.replaceChildren(...pairs.map(([value, text, title = text]) => Object.assign(new Option(text, value), { title })));
}
