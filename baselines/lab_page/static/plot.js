// One chart on a canvas: what baselines/lab_page/chart.py describes.
const TOKENS = ["x1", "x2", "xr", "u", "ink", "soft", "line", "paper", "wash", "good", "warn", "bad", "accent"];

function tidy(span, most) {
  const raw = span / most, size = Math.pow(10, Math.floor(Math.log10(raw)));
  for (const m of [1, 2, 5, 10]) if (m * size >= raw) return m * size;
  return 10 * size;
}

function text(v) {
  if (v === 0) return "0";
  const a = Math.abs(v);
  const s = a >= 1e5 || a < 1e-3 ? v.toExponential(0) : String(+v.toPrecision(3));
  return s.replace(/-/g, "−");
}

function ticks(low, high, log, most) {
  const found = [];
  if (log) {
    const few = Math.log10(high / low) < 1.5;
    for (let d = Math.floor(Math.log10(low)); d <= Math.ceil(Math.log10(high)); d++)
      for (const m of few ? [1, 2, 5] : [1]) { const v = m * Math.pow(10, d); if (v >= low * 0.999 && v <= high * 1.001) found.push(v); }
    return found;
  }
  const step = tidy(high - low, most);
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) found.push(Math.abs(v) < 1e-9 * step ? 0 : v);
  return found;
}

export default {
  template: `
    <figure class="lab-plot">
      <figcaption>{{ chart ? chart.title : "" }}</figcaption>
      <div class="lab-legend" v-if="legend.length"><span v-for="s in legend" :key="s.name"><i :style="{ background: 'var(--lab-' + s.colour + ')' }"></i>{{ s.name }}</span></div>
      <canvas ref="canvas" role="img" :aria-label="chart ? chart.summary || chart.title : ''"
        @pointerdown="press" @pointermove="move" @pointerup="lift" @dblclick="whole"></canvas>
    </figure>`,
  props: { chart: Object },
  emits: ["brush"],
  computed: { legend() { return this.chart ? this.chart.series.filter((s) => s.name) : []; } },
  created() { this.colours = {}; this.brushed = null; },
  mounted() {
    this.watcher = new ResizeObserver(() => this.draw());
    this.watcher.observe(this.$refs.canvas);
    this.theme = new MutationObserver(() => this.repaint());
    this.theme.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    this.repaint();
  },
  unmounted() { this.watcher.disconnect(); this.theme.disconnect(); },
  watch: { chart() { this.draw(); } },
  methods: {
    repaint() {
      const style = getComputedStyle(this.$el);
      for (const t of TOKENS) this.colours[t] = style.getPropertyValue("--lab-" + t).trim();
      this.draw();
    },
    range(axis, key, others) {
      let low = axis.low, high = axis.high;
      if (low === null || high === null) {
        let a = Infinity, b = -Infinity;
        for (const s of this.chart.series) for (const v of s[key]) if (v !== null && !(axis.log && v <= 0)) { if (v < a) a = v; if (v > b) b = v; }
        for (const l of others) if (!(axis.log && l.at <= 0)) { a = Math.min(a, l.at); b = Math.max(b, l.at); }
        if (a === Infinity) { a = axis.log ? 0.1 : -1; b = 1; }
        if (axis.log) { a /= 1.15; b *= 1.15; if (b / a < 3) { a /= 1.6; b *= 1.6; } } else { const pad = 0.05 * (b - a || 2); a -= pad; b += pad; }
        low = low === null ? a : low; high = high === null ? b : high;
      }
      return [low, high];
    },
    draw() {
      const canvas = this.$refs.canvas;
      if (!canvas || !this.chart || !this.colours.ink) return;
      const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect(), w = box.width, h = box.height;
      if (w < 20) return;
      canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio);
      const g = canvas.getContext("2d"), c = this.colours, chart = this.chart;
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      const f = { left: 48, top: 8, right: w - 10, bottom: h - 34 };
      let [xl, xh] = this.range(chart.x, "x", chart.lines.filter((l) => l.across === "x"));
      let [yl, yh] = this.range(chart.y, "y", chart.lines.filter((l) => l.across === "y"));
      if (chart.equal) {
        const scale = Math.max((xh - xl) / (f.right - f.left), (yh - yl) / (f.bottom - f.top));
        const cx = (xl + xh) / 2, cy = (yl + yh) / 2, dx = (scale * (f.right - f.left)) / 2, dy = (scale * (f.bottom - f.top)) / 2;
        [xl, xh, yl, yh] = [cx - dx, cx + dx, cy - dy, cy + dy];
      }
      const map = (v, low, high, from, to, log) => log ? from + (Math.log(v / low) / Math.log(high / low)) * (to - from) : from + ((v - low) / (high - low)) * (to - from);
      const X = (v) => map(v, xl, xh, f.left, f.right, chart.x.log), Y = (v) => map(v, yl, yh, f.bottom, f.top, chart.y.log);
      this.back = (px) => chart.x.log ? xl * Math.pow(xh / xl, (px - f.left) / (f.right - f.left)) : xl + ((px - f.left) / (f.right - f.left)) * (xh - xl);
      g.fillStyle = c.wash; g.fillRect(f.left, f.top, f.right - f.left, f.bottom - f.top);
      g.font = "11px system-ui"; g.lineWidth = 1; g.strokeStyle = c.line; g.fillStyle = c.soft;
      g.textAlign = "center";
      for (const v of ticks(xl, xh, chart.x.log, Math.max(3, w / 75))) {
        g.beginPath(); g.moveTo(X(v), f.top); g.lineTo(X(v), f.bottom); g.stroke(); g.fillText(text(v), X(v), f.bottom + 14);
      }
      g.textAlign = "right";
      for (const v of ticks(yl, yh, chart.y.log, Math.max(3, h / 45))) {
        g.beginPath(); g.moveTo(f.left, Y(v)); g.lineTo(f.right, Y(v)); g.stroke(); g.fillText(text(v), f.left - 5, Y(v) + 4);
      }
      g.textAlign = "center"; g.fillText(chart.x.label, (f.left + f.right) / 2, h - 5);
      g.save(); g.translate(11, (f.top + f.bottom) / 2); g.rotate(-Math.PI / 2); g.fillText(chart.y.label, 0, 0); g.restore();
      g.save(); g.beginPath(); g.rect(f.left, f.top, f.right - f.left, f.bottom - f.top); g.clip();
      if (chart.circle) {
        g.strokeStyle = c.soft; g.setLineDash([3, 4]); g.beginPath();
        g.ellipse(X(0), Y(0), X(1) - X(0), Y(0) - Y(1), 0, 0, 7); g.stroke(); g.setLineDash([]);
      }
      for (const line of chart.lines) {
        g.strokeStyle = c[line.colour]; g.lineWidth = line.label ? 2 : 1.2; g.setLineDash(line.label ? [] : [5, 4]);
        g.beginPath();
        if (line.across === "x") { g.moveTo(X(line.at), f.top); g.lineTo(X(line.at), f.bottom); } else { g.moveTo(f.left, Y(line.at)); g.lineTo(f.right, Y(line.at)); }
        g.stroke(); g.setLineDash([]);
        if (line.label) { g.fillStyle = c[line.colour]; g.textAlign = "left"; g.fillText(line.label, f.left + 6, Math.max(f.top + 11, Y(line.at) - 5)); }
      }
      for (const s of chart.series) this.series(g, s, X, Y, c);
      if (this.brushed) {
        g.globalAlpha = 0.18; g.fillStyle = c.accent;
        g.fillRect(Math.min(this.brushed.from, this.brushed.to), f.top, Math.abs(this.brushed.to - this.brushed.from), f.bottom - f.top); g.globalAlpha = 1;
      }
      g.restore();
    },
    series(g, s, X, Y, c) {
      g.strokeStyle = c[s.colour]; g.fillStyle = c[s.colour]; g.lineWidth = s.width; g.lineJoin = "round";
      if (s.kind === "line") {
        g.setLineDash(s.dash ? [5, 4] : []); g.beginPath();
        let pen = false;
        for (let i = 0; i < s.x.length; i++) {
          if (s.x[i] === null || s.y[i] === null) { pen = false; continue; }
          if (pen) g.lineTo(X(s.x[i]), Y(s.y[i])); else g.moveTo(X(s.x[i]), Y(s.y[i]));
          pen = true;
        }
        g.stroke(); g.setLineDash([]);
        return;
      }
      for (let i = 0; i < s.x.length; i++) {
        if (s.x[i] === null || s.y[i] === null) continue;
        const x = X(s.x[i]), y = Y(s.y[i]);
        if (s.kind === "dots") { g.globalAlpha = s.colour === "soft" ? 0.55 : 0.7; g.fillRect(x - 1.1, y - 1.1, 2.2, 2.2); g.globalAlpha = 1; continue; }
        g.lineWidth = 2.6; g.beginPath();
        g.moveTo(x - 5, y - 5); g.lineTo(x + 5, y + 5); g.moveTo(x - 5, y + 5); g.lineTo(x + 5, y - 5); g.stroke();
      }
    },
    place(e) { return e.clientX - this.$refs.canvas.getBoundingClientRect().left; },
    press(e) { if (!this.chart.brush) return; this.$refs.canvas.setPointerCapture(e.pointerId); this.brushed = { from: this.place(e), to: this.place(e) }; },
    move(e) { if (!this.brushed) return; this.brushed.to = this.place(e); this.draw(); },
    lift() {
      if (!this.brushed) return;
      const { from, to } = this.brushed;
      this.brushed = null;
      if (Math.abs(to - from) > 8) this.$emit("brush", { from: this.back(Math.min(from, to)), to: this.back(Math.max(from, to)) });
      this.draw();
    },
    whole() { if (this.chart.brush) this.$emit("brush", { from: null, to: null }); },
  },
};
