// The acceleration of an orbit as a sound, one period again and again: rattle is heard.

const PITCH = 90; // forcing periods a second

export class Sound {
  on = false;

  /** Begin or end; whether it sounds now. */
  toggle(motion, coordinate) {
    this.on = !this.on;
    if (this.on) this.play(motion, coordinate);
    else this.stop();
    return this.on;
  }

  play(motion, coordinate) {
    if (!this.on || !motion) return;
    this.context ??= new AudioContext();
    const values = motion.a[coordinate], last = values.length - 1;
    const periods = motion.theta[last] - motion.theta[0];
    const count = Math.max(64, Math.round((this.context.sampleRate / PITCH) * periods));
    const buffer = this.context.createBuffer(1, count, this.context.sampleRate), wave = buffer.getChannelData(0);
    const mean = values.reduce((sum, v) => sum + v, 0) / values.length;
    const size = Math.max(1e-300, ...values.map((v) => Math.abs(v - mean)));
    for (let i = 0; i < count; i++) {
      const at = (i / count) * last, k = Math.floor(at), part = at - k;
      wave[i] = (0.25 * (values[k] * (1 - part) + values[Math.min(k + 1, last)] * part - mean)) / size;
    }
    this.stop();
    this.source = this.context.createBufferSource();
    this.source.buffer = buffer;
    this.source.loop = true;
    this.source.connect(this.context.destination);
    this.source.start();
  }

  stop() {
    this.source?.stop();
    this.source = null;
  }
}
