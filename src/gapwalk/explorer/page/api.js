// Requests to the server. Every error becomes a sentence.

import { save } from "./dom.js";

export class Refused extends Error {}

/** Send a request; `signal` cancels it. */
export async function get(path, query = {}, signal = undefined) {
  return answer(await reach(`${path}?${new URLSearchParams(query)}`, { signal }));
}

/** Send a command. */
export async function post(path, body) {
  const headers = { "content-type": "application/json" };
  return answer(await reach(path, { method: "POST", headers, body: JSON.stringify(body) }));
}

/** Save a file of the server; an error is shown, not saved. */
export async function download(path, query) {
  const response = await reach(`${path}?${new URLSearchParams(query)}`);
  if (!response.ok) await answer(response);
  const [, whole, plain] = /filename\*=utf-8''([^;]+)|filename="?([^"]+)"?/i.exec(response.headers.get("content-disposition") ?? "") ?? [];
  const name = whole ? decodeURIComponent(whole) : plain ?? "gapwalk";
  save(await response.blob(), name);
}

/** Fetch the samples of a sound: { rate, values }. */
export async function samples(path, query) {
  const response = await reach(`${path}?${new URLSearchParams(query)}`);
  if (!response.ok) await answer(response);
  return { rate: Number(response.headers.get("x-rate")), values: new Float32Array(await response.arrayBuffer()) };
}

async function reach(path, options) {
  try {
    return await fetch(path, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refused("The server does not answer. Is `gapwalk explore` still running? Start it again; this page then reconnects by itself.");
  }
}

async function answer(response) {
  const text = await response.text();
  let content;
  try {
    content = JSON.parse(text);
  } catch {
    throw new Refused(text || `The server answered ${response.status}.`);
  }
  if (!response.ok) throw new Refused(content.error ?? `The server answered ${response.status}.`);
  return content;
}

/** Send a command whose answer is a stream of lines of JSON, and yield each; `signal` cancels it. */
export async function* stream(path, body, signal) {
  const headers = { "content-type": "application/json" };
  const response = await reach(path, { method: "POST", headers, body: JSON.stringify(body), signal });
  if (!response.ok) await answer(response);
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read();
    const lines = (rest + (value ?? "")).split("\n");
    rest = lines.pop();
    for (const line of lines) yield JSON.parse(line);
    if (done) return;
  }
}
