// Sounds at true pitch, all of a signal at one scale: a quiet motion is as much quieter than a rattling one as it is.

const $ = (id) => document.getElementById(id);
const SECOND = 2 * Math.PI * 90; // units of time that a second lasts without units, as in spectrum.py
const HEADROOM = 4, ROOM = 1.25; // of the first sound of a signal; of one that exceeded the scale
const FADE = 0.004; // seconds in which a motion that does not repeat fades at the ends of its loop
const SHORTEST = 0.25; // seconds of a loop

/** The scale of all sounds: amplitudes by signal that are as loud as the speakers go, and the volume. */
class Loudness {
  constructor() {
    Object.assign(this, { scales: new Map(), loudest: new Map(), context: null, volume: 1 });
  }

  /** The audio of the page, which only a click may open. */
  get audio() {
    this.context ??= new AudioContext();
    this.output ??= new GainNode(this.context, { gain: this.volume });
    this.output.connect(this.context.destination);
    return this.context;
  }

  turn(volume) {
    this.volume = volume;
    if (this.output) this.output.gain.value = volume;
  }

  /** The scale for samples of a signal; it grows where they would not fit, and `said` says so. */
  fit(signal, values, unit = "") {
    const peak = peakOf(values), before = this.scales.get(signal);
    const scale = before === undefined ? HEADROOM * peak || 1 : peak > before ? ROOM * peak : before;
    this.scales.set(signal, scale);
    const level = levelOf(values), loudest = Math.max(level, this.loudest.get(signal) ?? 0);
    this.loudest.set(signal, loudest);
    const grown = before !== undefined && scale > before ? ` All sounds of it are ${decibels(scale / before)} quieter from now on, so that this one fits.` : "";
    return { scale, level, said: `Root mean square ${short(level)} ${unit}`.trimEnd() + `${loudest > level ? `, ${decibels(loudest / level)} below the loudest that was heard` : ""}.${grown}` };
  }
}

export const loudness = new Loudness();

/** The acceleration of a motion as a sound, its periods again and again: rattle can be heard. */
export class Sound {
  on = false;

  /** Start or stop; return true if it plays now. */
  toggle(motion, coordinate) {
    this.on = !this.on;
    if (this.on) this.play(motion, coordinate);
    else this.stop();
    return this.on;
  }

  play(motion, coordinate) {
    if (!this.on || !motion) return;
    const { audio } = loudness, { values, rate } = loopOf(motion, coordinate, audio.sampleRate), signal = `${coordinate}''`;
    const { scale, said } = loudness.fit(signal, values, motion.has_units ? "rad/s²" : "");
    const buffer = audio.createBuffer(1, values.length, audio.sampleRate), wave = buffer.getChannelData(0);
    for (let i = 0; i < wave.length; i++) wave[i] = values[i] / scale;
    this.stop();
    this.source = new AudioBufferSourceNode(audio, { buffer, loop: true, playbackRate: rate });
    this.source.connect(loudness.output);
    this.source.start();
    Object.assign($("sound-note"), { hidden: false, textContent: `${said} ${pitchOf(motion)}` });
  }

  stop() {
    this.source?.stop();
    this.source = null;
    $("sound-note").hidden = true;
  }
}

/** How many seconds a period of the excitation is heard. */
const heardFor = ({ has_units: units, seconds }) => (units ? seconds : seconds / SECOND);

function pitchOf(motion) {
  const hertz = 1 / heardFor(motion);
  return motion.has_units ? `The excitation is heard at ${short(hertz)} Hz, as it is.` : `The excitation is heard at ${short(hertz)} Hz: Ω = 1 is 90 Hz.`;
}

/**
 * One loop of an acceleration, without its mean, in its unit: { values, rate }.
 *
 * `rate` is by how much faster than the speakers' rate it is played, so that its pitch is exact though the loop has a
 * whole number of samples.
 */
export function loopOf(motion, coordinate, speed) {
  const own = motion.a[coordinate], last = own.length - 1, first = motion.theta[0], periods = motion.theta[last] - first;
  const once = periods * heardFor(motion), turns = motion.period ? Math.max(1, Math.ceil(SHORTEST / once)) : 1, exact = once * turns * speed;
  const count = Math.max(64, Math.round(exact)), values = new Float64Array(count), step = (periods * turns) / count;
  for (let i = 0, k = 0, turn = 0; i < count; i++) {
    const now = Math.floor((i * step) / periods + 1e-12), at = first + i * step - now * periods; // the samples need not be even
    if (now > turn) [k, turn] = [0, now];
    while (k < last - 1 && motion.theta[k + 1] <= at) k++;
    const part = Math.min(1, Math.max(0, (at - motion.theta[k]) / (motion.theta[k + 1] - motion.theta[k] || 1)));
    values[i] = own[k] * (1 - part) + own[Math.min(k + 1, last)] * part;
  }
  const [at, jumps] = motion.struck?.[coordinate] ?? [[], []]; // a jump of the velocity is the area of one sample
  const unit = step * motion.seconds;
  for (let turn = 0; turn < turns; turn++) at.forEach((theta, j) => {
    const place = (theta - first + turn * periods) / step, k = Math.floor(place), part = place - k;
    values[((k % count) + count) % count] += ((1 - part) * jumps[j]) / unit;
    values[(((k + 1) % count) + count) % count] += (part * jumps[j]) / unit;
  });
  const mean = values.reduce((sum, v) => sum + v, 0) / count;
  const ends = motion.period ? 0 : Math.min(count / 2, FADE * speed);
  for (let i = 0; i < count; i++) values[i] = (values[i] - mean) * (ends ? Math.min(1, i / ends, (count - 1 - i) / ends) : 1);
  return { values, rate: count / exact };
}

/** The largest magnitude. */
export function peakOf(values) {
  let peak = 0;
  for (const v of values) if (v > peak) peak = v; else if (-v > peak) peak = -v;
  return peak;
}

/** The root mean square. */
export function levelOf(values) {
  let sum = 0;
  for (const v of values) sum += v * v;
  return Math.sqrt(sum / (values.length || 1));
}

export function decibels(ratio) {
  return `${(20 * Math.log10(ratio)).toFixed(1)} dB`;
}

export function short(value) {
  return value !== 0 && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3) ? value.toExponential(2) : String(Number(value.toPrecision(3)));
}
