// The rig and its strip charts, animated from one simulated run that came as arrays.
// Positions are in the rig's units; the clock is that of the rig.
const TOKENS = ["x1", "x2", "xr", "u", "ink", "soft", "line", "paper", "wash", "cart1", "cart2", "accent"];

function unpack(text) {
  if (!text) return null;
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Float32Array(bytes.buffer); // little-endian, as every browser's machine is
}

function fit(canvas) {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  const w = Math.round(box.width * ratio), h = Math.round(box.height * ratio);
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  return [g, box.width, box.height];
}

function bounds(arrays) {
  let low = Infinity, high = -Infinity;
  for (const a of arrays) if (a) for (let i = 0; i < a.length; i++) { if (a[i] < low) low = a[i]; if (a[i] > high) high = a[i]; }
  if (!(high > low)) { low = (low === Infinity ? 0 : low) - 1; high = low + 2; }
  return [low, high];
}

function tidy(span, most) {
  const raw = span / most, size = Math.pow(10, Math.floor(Math.log10(raw)));
  for (const m of [1, 2, 5, 10]) if (m * size >= raw) return m * size;
  return 10 * size;
}

const label = (v, step) => v.toFixed(Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)))).replace("-", "−");

export default {
  template: `
    <div class="lab-rig">
      <canvas ref="rig" class="lab-rig-canvas" role="img" :aria-label="texts.summary"
        @pointerdown="grab" @pointermove="pull" @pointerup="release" @pointercancel="drop"></canvas>
      <p v-if="note" class="lab-note" role="status">{{ note }}</p>
      <div class="lab-transport" role="group" :aria-label="texts.rig">
        <button type="button" class="lab-play" @click="toggle" :aria-label="playing ? texts.pause : texts.play">
          <svg viewBox="0 0 24 24" aria-hidden="true"><path v-if="playing" d="M6 5h4v14H6zM14 5h4v14h-4z"/><path v-else d="M7 4l13 8-13 8z"/></svg>
        </button>
        <button type="button" @click="restart" :aria-label="texts.restart">
          <svg viewBox="0 0 24 24" aria-hidden="true"><path d="M5 5h3v14H5zM20 5v14L9 12z"/></svg>
        </button>
        <input class="lab-scrub" type="range" min="0" :max="seconds" :step="0.01" v-model.number="shown" @input="scrub"
          :aria-label="texts.instant" :aria-valuetext="shown.toFixed(2) + ' s'">
        <output class="lab-clock">{{ shown.toFixed(2) }} s</output>
        <select v-model.number="rate" :aria-label="texts.speed">
          <option v-for="r in [0.1, 0.25, 0.5, 1]" :key="r" :value="r">{{ r === 1 ? texts.real : "× " + r }}</option>
        </select>
      </div>
      <canvas ref="strips" class="lab-strips" role="img" :aria-label="texts.strips"
        @pointerdown="seek" @pointermove="seekMore" @pointerup="seekEnd"></canvas>
    </div>`,
  props: { payload: Object, texts: Object },
  emits: ["push"],
  data() { return { playing: false, rate: 1, shown: 0, seconds: 8, note: "" }; },
  created() { this.runs = []; this.time = 0; this.last = 0; this.held = null; this.sheet = null; this.colours = {}; },
  mounted() {
    this.take(this.payload);
    this.watcher = new ResizeObserver(() => { this.sheet = null; this.draw(); });
    this.watcher.observe(this.$refs.rig);
    this.watcher.observe(this.$refs.strips);
    this.theme = new MutationObserver(() => this.repaint());
    this.theme.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) this.toggle();
  },
  unmounted() { this.watcher.disconnect(); this.theme.disconnect(); cancelAnimationFrame(this.frame); },
  watch: { payload(value) { this.take(value); } },
  methods: {
    take(payload) {
      if (!payload || !payload.runs) return;
      this.runs = payload.runs.map((r) => ({
        ...r, x1: unpack(r.x1), x2: unpack(r.x2), xr: unpack(r.xr), u: unpack(r.u),
      }));
      this.seconds = payload.seconds;
      this.note = payload.note || "";
      this.travel = payload.travel;
      this.counted = payload.number;
      if (this.time > this.seconds) this.time = 0;
      this.repaint();
      // what a test reads: which run is on the screen, and when it came
      this.$el.dataset.number = payload.number;
      this.$el.dataset.peak = Math.max(...this.runs[0].x1.map(Math.abs)).toFixed(2);
    },
    repaint() {
      const style = getComputedStyle(this.$el);
      for (const t of TOKENS) this.colours[t] = style.getPropertyValue("--lab-" + t).trim();
      this.sheet = null;
      this.draw();
    },
    toggle() {
      this.playing = !this.playing;
      if (this.playing) {
        if (this.time >= this.seconds - 1e-6) this.time = 0;
        this.last = performance.now();
        this.frame = requestAnimationFrame(this.tick);
      }
    },
    tick(now) {
      if (!this.playing) return;
      if (!this.held) this.time += Math.min(0.1, (now - this.last) / 1000) * this.rate;
      this.last = now;
      if (this.time >= this.seconds) this.time = 0;
      this.shown = Math.round(this.time * 100) / 100;
      this.draw();
      this.frame = requestAnimationFrame(this.tick);
    },
    restart() { this.time = 0; this.shown = 0; this.draw(); },
    scrub() { this.time = this.shown; this.draw(); },
    now() { return this.time; },
    at(array, run) {
      if (!array) return 0;
      const place = Math.min(this.time / run.step, array.length - 1), i = Math.floor(place), j = Math.min(i + 1, array.length - 1);
      return array[i] + (place - i) * (array[j] - array[i]);
    },
    draw() {
      if (!this.$refs.rig || !this.runs.length || !this.colours.ink) return;
      this.drawRig();
      this.drawStrips();
    },
    // ---- the rig -------------------------------------------------------------------------------------------------------------
    drawRig() {
      const [g, w, h] = fit(this.$refs.rig), c = this.colours, lanes = this.runs.length;
      g.clearRect(0, 0, w, h);
      let [low, high] = bounds(this.runs.flatMap((r) => [r.x1, r.x2, r.xr]));
      const reach = Math.max(high - low, this.runs[0].scale || 0, 1e-9);
      low -= 0.06 * reach; high += 0.06 * reach;
      const cart = Math.max(44, Math.min(150, 0.15 * w)), room = w - 24 - 2 * cart - 0.14 * w;
      const scale = room / (high - low), gap = cart + 0.14 * w;
      const place = (x) => 12 + (x - low) * scale;
      this.boxes = [];
      this.runs.forEach((run, lane) => {
        const height = h / lanes, ground = lane * height + height - 26, tall = Math.max(26, Math.min(0.72 * cart, height - 84));
        const x1 = place(this.at(run.x1, run)), x2 = run.x2 ? place(this.at(run.x2, run)) + gap : null;
        if (lanes > 1) { g.fillStyle = c.soft; g.font = "600 12px system-ui"; g.textAlign = "left"; g.fillText(run.name, 12, lane * height + 15); }
        this.track(g, w, ground, low, high, place, run, gap, cart);
        if (run.xr) this.flag(g, place(this.at(run.xr, run)) + (x2 === null ? 0 : gap) + cart / 2, ground, tall);
        if (x2 !== null) this.spring(g, x1 + cart, x2, ground - 0.5 * tall);
        this.arrow(g, x1 + cart / 2, ground - tall - 12, this.at(run.u, run) * 6 * (run.arrow || 1), c.u, "u");
        this.cart(g, x1, ground, cart, tall, c.cart1, "1", lane, 1);
        if (x2 !== null) this.cart(g, x2, ground, cart, tall, c.cart2, "2", lane, 2);
      });
      if (this.held) {
        const b = this.held;
        this.arrow(g, b.x, b.y, b.now - b.x, c.accent, "");
      }
    },
    track(g, w, ground, low, high, place, run, gap, cart) {
      const c = this.colours;
      g.fillStyle = c.line;
      g.fillRect(0, ground, w, 3);
      const step = tidy(high - low, Math.max(3, Math.floor(w / 90)));
      g.font = "11px system-ui"; g.textAlign = "center"; g.fillStyle = c.soft; g.strokeStyle = c.line; g.lineWidth = 1;
      const shift = (run.x2 ? gap : 0) + cart / 2;
      for (let v = Math.ceil(low / step) * step; v <= high + 1e-9; v += step) {
        const x = place(v) + shift;
        g.beginPath(); g.moveTo(x, ground + 3); g.lineTo(x, ground + 8); g.stroke();
        g.fillText(label(v, step), x, ground + 20);
      }
      g.textAlign = "left";
      g.fillText((run.x2 ? "x2" : "x1") + " [" + run.length + "]", 4, ground + 20);
    },
    flag(g, x, ground, tall) {
      const c = this.colours;
      g.strokeStyle = c.xr; g.fillStyle = c.xr; g.lineWidth = 1.5; g.setLineDash([4, 4]);
      g.beginPath(); g.moveTo(x, ground); g.lineTo(x, ground - tall - 26); g.stroke(); g.setLineDash([]);
      g.beginPath(); g.moveTo(x, ground - tall - 26); g.lineTo(x + 13, ground - tall - 21); g.lineTo(x, ground - tall - 16); g.fill();
      g.font = "italic 12px system-ui"; g.textAlign = "right"; g.fillText("xr", x - 4, ground - tall - 18);
    },
    spring(g, from, to, y) {
      const c = this.colours, turns = 9, lead = 8, span = to - from - 2 * lead;
      g.strokeStyle = c.ink; g.lineWidth = 2; g.lineJoin = "round";
      g.beginPath(); g.moveTo(from, y); g.lineTo(from + lead, y);
      for (let i = 0; i < turns; i++) g.lineTo(from + lead + (span * (i + 0.5)) / turns, y + (i % 2 ? 9 : -9));
      g.lineTo(to - lead, y); g.lineTo(to, y); g.stroke();
    },
    cart(g, x, ground, wide, tall, colour, name, lane, number) {
      const c = this.colours, wheel = Math.min(9, tall / 4), top = ground - tall;
      g.fillStyle = colour;
      g.beginPath(); g.roundRect(x, top, wide, tall - wheel, 7); g.fill();
      g.fillStyle = c.ink;
      for (const at of [0.24, 0.76]) { g.beginPath(); g.arc(x + at * wide, ground - wheel, wheel, 0, 7); g.fill(); }
      g.fillStyle = c.paper;
      for (const at of [0.24, 0.76]) { g.beginPath(); g.arc(x + at * wide, ground - wheel, wheel * 0.4, 0, 7); g.fill(); }
      g.fillStyle = "#fff"; g.font = "600 15px system-ui"; g.textAlign = "center";
      g.fillText(name === "1" ? (wide > 80 ? "motor · 1" : "1") : name, x + wide / 2, top + (tall - wheel) / 2 + 4);
      this.boxes.push({ x, y: top, w: wide, h: tall, lane, number });
    },
    arrow(g, x, y, length, colour, name) {
      if (Math.abs(length) < 1.5) return;
      const s = Math.sign(length);
      g.strokeStyle = colour; g.fillStyle = colour; g.lineWidth = 3;
      g.beginPath(); g.moveTo(x, y); g.lineTo(x + length - s * 6, y); g.stroke();
      g.beginPath(); g.moveTo(x + length, y); g.lineTo(x + length - s * 9, y - 5); g.lineTo(x + length - s * 9, y + 5); g.fill();
      if (Math.abs(length) < 16) return;
      g.font = "italic 12px system-ui"; g.textAlign = s > 0 ? "right" : "left"; g.fillText(name, x - s * 5, y + 4);
    },
    // ---- striking a cart -----------------------------------------------------------------------------------------------------
    grab(e) {
      const box = this.$refs.rig.getBoundingClientRect(), x = e.clientX - box.left, y = e.clientY - box.top;
      const hit = (this.boxes || []).find((b) => x >= b.x - 4 && x <= b.x + b.w + 4 && y >= b.y - 8 && y <= b.y + b.h + 4);
      if (!hit) return;
      this.$refs.rig.setPointerCapture(e.pointerId);
      this.held = { ...hit, x, y, now: x };
      this.draw();
    },
    pull(e) {
      if (!this.held) return;
      this.held.now = e.clientX - this.$refs.rig.getBoundingClientRect().left;
      this.draw();
    },
    release() {
      if (!this.held) return;
      const way = this.held.now - this.held.x, cart = this.held.number;
      this.held = null;
      if (Math.abs(way) > 6) this.$emit("push", { cart, time: this.time, way });
      this.draw();
    },
    drop() { this.held = null; this.draw(); },
    // ---- strip charts --------------------------------------------------------------------------------------------------------
    drawStrips() {
      const [g, w, h] = fit(this.$refs.strips);
      if (!this.sheet || this.sheet.width !== this.$refs.strips.width || this.sheet.height !== this.$refs.strips.height) this.paintSheet(w, h);
      g.save(); g.setTransform(1, 0, 0, 1, 0, 0);
      g.clearRect(0, 0, this.$refs.strips.width, this.$refs.strips.height);
      g.drawImage(this.sheet, 0, 0); g.restore();
      const c = this.colours, f = this.frameOf(w), x = f.left + (this.time / this.seconds) * f.wide;
      g.strokeStyle = c.accent; g.lineWidth = 1.5;
      g.beginPath(); g.moveTo(x, 8); g.lineTo(x, h - 20); g.stroke();
      const run = this.runs[0], pairs = [["x1", run.x1], ["x2", run.x2], ["xr", run.xr], ["u", run.u]].filter((p) => p[1]);
      g.font = "600 12px system-ui"; g.textAlign = "left";
      const wide = f.wide / pairs.length;
      pairs.forEach(([name, values], i) => {
        g.fillStyle = c[name];
        const unit = name === "u" ? run.command : run.length, v = this.at(values, run);
        g.fillText(`${name} ${Math.abs(v) < 1e4 ? v.toFixed(unit === "mm" ? 1 : 2).replace("-", "−") : "∞"}${w > 460 ? " " + unit : ""}`, f.left + 4 + i * wide, 14);
      });
    },
    frameOf(w) { return { left: 46, wide: w - 56 }; },
    paintSheet(w, h) {
      this.sheet = document.createElement("canvas");
      this.sheet.width = this.$refs.strips.width; this.sheet.height = this.$refs.strips.height;
      const ratio = this.sheet.width / w, g = this.sheet.getContext("2d"), f = this.frameOf(w);
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      const top = 22, middle = 14, low = h - 22, split = top + (low - top - middle) * 0.64;
      const first = this.runs[0];
      this.strip(g, f, top, split, this.runs.flatMap((r) => [r.x1, r.x2, r.xr]), first.length,
        this.runs.flatMap((r, i) => [["xr", r.xr, r], ["x1", r.x1, r], ["x2", r.x2, r]].map((s) => [...s, i])));
      this.strip(g, f, split + middle, low, this.runs.map((r) => r.u), first.command, this.runs.map((r, i) => ["u", r.u, r, i]));
      g.fillStyle = this.colours.soft; g.font = "11px system-ui"; g.textAlign = "center";
      const step = tidy(this.seconds, Math.max(4, Math.floor(w / 80)));
      for (let t = 0; t <= this.seconds + 1e-9; t += step) g.fillText(label(t, step) + (t === 0 ? " s" : ""), f.left + (t / this.seconds) * f.wide, h - 6);
    },
    strip(g, f, top, bottom, arrays, unit, lines) {
      const c = this.colours;
      let [low, high] = bounds(arrays);
      const pad = 0.06 * (high - low); low -= pad; high += pad;
      const y = (v) => bottom - ((v - low) / (high - low)) * (bottom - top), step = tidy(high - low, Math.max(2, (bottom - top) / 24));
      g.fillStyle = c.wash; g.fillRect(f.left, top, f.wide, bottom - top);
      g.strokeStyle = c.line; g.fillStyle = c.soft; g.lineWidth = 1; g.font = "11px system-ui"; g.textAlign = "right";
      for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
        g.beginPath(); g.moveTo(f.left, y(v)); g.lineTo(f.left + f.wide, y(v)); g.stroke();
        g.fillText(label(v, step), f.left - 5, y(v) + 4);
      }
      g.save(); g.translate(11, (top + bottom) / 2); g.rotate(-Math.PI / 2); g.textAlign = "center"; g.fillText(unit, 0, 0); g.restore();
      g.save(); g.beginPath(); g.rect(f.left, top, f.wide, bottom - top); g.clip();
      for (const [name, values, run, lane] of lines) {
        if (!values || (lane && name === "xr")) continue;
        g.strokeStyle = c[name]; g.globalAlpha = lane ? 0.55 : 1; g.lineWidth = name === "xr" ? 1.5 : lane ? 1.4 : 2;
        g.setLineDash(name === "xr" ? [5, 4] : lane ? [3, 3] : []);
        g.lineJoin = "round"; g.beginPath();
        const every = Math.max(1, Math.floor(values.length / (2 * f.wide)));
        for (let i = 0; i < values.length; i += every) {
          const px = f.left + ((i * run.step) / this.seconds) * f.wide;
          if (i) g.lineTo(px, y(values[i])); else g.moveTo(px, y(values[i]));
        }
        g.stroke();
      }
      g.restore(); g.globalAlpha = 1; g.setLineDash([]);
    },
    seek(e) { this.$refs.strips.setPointerCapture(e.pointerId); this.seeking = true; this.seekMore(e); },
    seekMore(e) {
      if (!this.seeking) return;
      const box = this.$refs.strips.getBoundingClientRect(), f = this.frameOf(box.width);
      this.time = Math.min(this.seconds, Math.max(0, ((e.clientX - box.left - f.left) / f.wide) * this.seconds));
      this.shown = Math.round(this.time * 100) / 100;
      this.draw();
    },
    seekEnd() { this.seeking = false; },
  },
};
