// Data of a saved page: they are in the file itself, in place of a server. Stands in for api.js.

const STEPS = 2 ** 14; // levels of a drawn curve, as in saved_page.py
const TYPES = { f8: Float64Array, f4: Float32Array, i4: Int32Array, i2: Int16Array, u1: Uint8Array };

const data = { shown: null, numbers: null };

/** Unpack the data of the file; to be awaited before any request. */
export async function open() {
  const [words, numbers] = await Promise.all([unzipped("shown"), unzipped("numbers")]);
  data.shown = JSON.parse(new TextDecoder().decode(words));
  data.numbers = numbers;
  return data.shown;
}

/** Unpack the compressed bytes in an element of the page. */
export async function unzipped(id) {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

/** Answer a request as the server does. */
export async function get(path, query = {}) {
  if (path === "/api/curve") return data.shown.motion ? { settled: null } : curve(query);
  if (path === "/api/motion") return withScenes(unpacked(motionAt(query)));
  if (path === "/api/answer") return unpacked(data.shown.answer);
  if (path === "/api/picture") return data.shown.pictures[query.number];
  if (path === "/api/gradient") return data.shown.branches[query.branch].gradients[query.special] ?? null;
  if (path === "/api/next") return next(query);
  if (path === "/api/details") return details(query);
  if (path === "/api/heard") return data.shown.heard?.maps[query.signal] ?? null;
  return null;
}

/** The samples of a sound: those of one signal are in the file. */
export function samples(path, { signal }) {
  const sound = data.shown.heard?.sound;
  if (!sound) throw new Error("This run-up is too long for a file that holds its sound. The explorer plays it, and gapwalk export --format wav saves it.");
  if (signal !== sound.of) throw new Error(`This file has the sound of ${sound.of}. The explorer plays that of every signal.`);
  return { rate: sound.rate, values: Float32Array.from(array(sound.levels), (level) => level * sound.scale) };
}

/** The index of the nearest node whose motion is in the file; on one side only if `way` is not 0. */
export function nearestStored(curve, index, way = 0) {
  const { motions } = data.shown.branches[curve.branch];
  for (let away = 0; away < curve.node.length; away++) {
    for (const k of way ? [index + way * away] : [index + away, index - away]) {
      if (k >= 0 && k < curve.node.length && String(curve.node[k]) in motions) return k;
    }
  }
  return way ? nearestStored(curve, index) : index;
}

function curve({ branch, x, y }) {
  const { name, period, count, quantities, node, label, special } = data.shown.branches[branch];
  const [xs, ys, nodes] = [x, y].map((each) => Float64Array.from(array(quantities[each]))).concat(array(node));
  const placed = special.map((each, i) => {
    const k = nodes.indexOf(-1 - i);
    return { ...each, x: xs[k], y: ys[k] };
  });
  return { name, period, count, x: xs, y: ys, node: nodes, label: array(label), special: placed };
}

function motionAt({ branch, point, special }) {
  if (data.shown.motion) return data.shown.motion;
  return data.shown.branches[branch].motions[special === undefined ? point : -1 - special];
}

/** What a special point means; without a server there are only the steps that need none. */
function next({ branch, special }) {
  const text = special === undefined ? "" : data.shown.branches[branch]?.next[special] ?? "";
  return { text, steps: [{ do: "hear", label: "Hear it" }, { do: "pin", label: "Compare others with it" }] };
}

/** Spectrum, section and energy; the spectrum of another signal would need the equations of motion. */
function details(query) {
  const { details: found, energy } = unpacked(motionAt(query)), isOther = query.signal !== found.signal;
  return { ...found, energy, missing: isOther ? `This file has the spectrum of ${found.signal}. The explorer shows that of every signal.` : "" };
}

/** The drawings of the machine are in the file once. */
function withScenes(motion) {
  return motion && { ...motion, machine: { ...motion.machine, scenes: data.shown.machine } };
}

function unpacked(value) {
  if (Array.isArray(value)) return value.map(unpacked);
  if (value === null || typeof value !== "object") return value;
  if (value.kind === "drawn") return drawn(value);
  return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, unpacked(each)]));
}

function array({ kind, at, n }) {
  return new TYPES[kind](data.numbers, at, n);
}

/** A curve from its second differences, modulo 2^16. */
function drawn({ at, n, low, high }) {
  const bytes = new Uint8Array(data.numbers, at, 2 * n), scale = (high - low) / (STEPS - 1), found = new Array(n);
  let step = 0, level = 0;
  for (let i = 0; i < n; i++) {
    step = (step + bytes[i] + 256 * bytes[n + i]) & 0xffff;
    level = (level + step) & 0xffff;
    found[i] = low + level * scale;
  }
  return found;
}
