// Interactive convergence plot: scene, axes and runs can be chosen; the point nearest to the mouse tells its numbers.
"use strict";

const SVG = "http://www.w3.org/2000/svg";

function svg(tag, attributes = {}, text) {
  const e = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
  if (text !== undefined) e.textContent = text;
  return e;
}

// Short text of a number.
function short(x) {
  if (!Number.isFinite(x)) return "–";
  const a = Math.abs(x);
  return a === 0 || (a >= 1e-3 && a < 1e5) ? String(Number(x.toPrecision(3))) : x.toExponential(2).replace("-", "−");
}

// Ticks of a logarithmic axis: decades, and numbers between them where the range is short; `most` of them at most.
function ticks(low, high, most = Infinity) {
  const decades = Math.log10(high / low), between = decades > 2.7 ? [1] : decades > 1.5 ? [1, 3] : decades > 0.8 ? [1, 2, 5] : [1, 1.5, 2, 3, 4, 5, 7];
  const out = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); ++e)
    for (const b of between) { const v = Number((b * 10 ** e).toPrecision(6)); if (v >= low && v <= high) out.push(v); }
  const step = Math.max(1, Math.ceil(out.length / most));
  return out.filter((_, i) => i % step === 0);
}

const AXIS = {seconds: "time (s)", spp: "samples per pixel", rmse: "RMSE", relmse: "relMSE", relmse_trimmed: "trimmed relMSE"};

class Plot {
  constructor(element, data) {
    this.element = element;
    this.data = data;  // {runs: [names], colours, measures: {rmse: "RMSE", ...}, scenes: {name: {noise, curves: {rmse: {seconds: {run: {seconds, spp, error, low, high, seeds}}, spp: ...}, ...}}}}
    this.scene = Object.keys(data.scenes)[0];
    this.x = "seconds";
    this.y = Object.keys(data.measures)[0];  // that of the metric that leads
    this.hidden = new Set();
    this.build();
    this.draw();
    element.dataset.ready = "yes";
  }

  build() {
    const select = (name, options, change) => {
      const s = document.createElement("select");
      s.className = name;
      s.setAttribute("aria-label", name);
      for (const [value, text] of options) s.append(new Option(text, value));
      s.onchange = () => { change(s.value); this.draw(); };
      return s;
    };
    const controls = document.createElement("div");
    controls.className = "controls";
    controls.append(
      select("scene", Object.keys(this.data.scenes).map(s => [s, s]), v => { this.scene = v; }),
      select("y", Object.entries(this.data.measures), v => { this.y = v; }), "against",
      select("x", [["seconds", "time"], ["spp", "samples per pixel"]], v => { this.x = v; }));
    this.legend = document.createElement("div");
    this.legend.className = "legend";
    this.data.runs.forEach((run, i) => {
      const b = document.createElement("button");
      b.type = "button";
      b.dataset.run = run;
      const mark = svg("svg", {width: 26, height: 12, "aria-hidden": "true"});
      mark.append(svg("line", {x1: 0, x2: 26, y1: 6, y2: 6, stroke: this.colour(i), "stroke-width": 2, "stroke-dasharray": this.dash(i)}), this.marker(i, 13, 6));
      b.append(mark, run);
      b.onclick = () => { this.hidden.has(run) ? this.hidden.delete(run) : this.hidden.add(run); this.draw(); };
      this.legend.append(b);
    });
    this.space = document.createElement("div");
    this.space.className = "space";
    this.told = document.createElement("div");
    this.told.className = "readout";
    this.element.append(controls, this.legend, this.space, this.told);
  }

  colour(i) { return this.data.colours[i % this.data.colours.length]; }
  dash(i) { return ["none", "6 3", "6 3 1 3", "1 3"][Math.floor(i / this.data.colours.length) % 4]; }

  marker(i, x, y, r = 3.6) {
    const shapes = [
      () => svg("circle", {cx: x, cy: y, r}),
      () => svg("rect", {x: x - r, y: y - r, width: 2 * r, height: 2 * r}),
      () => svg("path", {d: `M${x} ${y - r * 1.2}L${x + r * 1.1} ${y + r}L${x - r * 1.1} ${y + r}Z`}),
      () => svg("path", {d: `M${x} ${y - r * 1.3}L${x + r * 1.3} ${y}L${x} ${y + r * 1.3}L${x - r * 1.3} ${y}Z`}),
      () => svg("path", {d: `M${x} ${y + r * 1.2}L${x + r * 1.1} ${y - r}L${x - r * 1.1} ${y - r}Z`}),
    ];
    const shape = shapes[i % shapes.length]();
    shape.setAttribute("fill", this.colour(i));
    return shape;
  }

  draw() {
    [...this.legend.children].forEach(b => b.setAttribute("aria-pressed", !this.hidden.has(b.dataset.run)));
    const scene = this.data.scenes[this.scene], curves = scene.curves[this.y][this.x];
    const shown = this.data.runs.map((run, i) => ({run, i, c: curves[run]})).filter(e => e.c && !this.hidden.has(e.run));
    const W = Math.max(300, Math.min(860, this.space.clientWidth || 860)), H = Math.round(Math.max(280, W / 2)), L = 66, R = 16, T = 14, B = 48;
    const root = svg("svg", {viewBox: `0 0 ${W} ${H}`, width: W, height: H, role: "img", "aria-label": `${AXIS[this.y]} against ${AXIS[this.x]}, ${this.scene}`});
    this.space.replaceChildren(root);
    this.told.textContent = "";
    if (!shown.length) { root.append(svg("text", {x: W / 2, y: H / 2, "text-anchor": "middle"}, "nothing to show")); return; }
    const xs = shown.flatMap(e => e.c[this.x]), ys = shown.flatMap(e => e.c.error);
    const range = (values, pad) => { const a = Math.min(...values), b = Math.max(...values); return [a / pad, b * pad]; };
    const [x0, x1] = range(xs, 1.15), [y0, y1] = range(ys, 1.35);
    const X = v => L + (W - L - R) * Math.log(v / x0) / Math.log(x1 / x0), Y = v => H - B - (H - T - B) * Math.log(v / y0) / Math.log(y1 / y0);
    const inside = svg("svg", {x: L, y: T, width: W - L - R, height: H - T - B, viewBox: `${L} ${T} ${W - L - R} ${H - T - B}`});  // cuts off bands and the guide
    for (const v of ticks(x0, x1, (W - L - R) / 45)) root.append(svg("line", {x1: X(v), x2: X(v), y1: T, y2: H - B, stroke: "#eee"}), svg("text", {x: X(v), y: H - B + 17, "text-anchor": "middle"}, short(v)));
    for (const v of ticks(y0, y1)) root.append(svg("line", {x1: L, x2: W - R, y1: Y(v), y2: Y(v), stroke: "#eee"}), svg("text", {x: L - 7, y: Y(v) + 4, "text-anchor": "end"}, short(v)));
    root.append(svg("path", {d: `M${L} ${T}V${H - B}H${W - R}`, fill: "none", stroke: "#222"}));
    root.append(svg("text", {x: (L + W - R) / 2, y: H - 8, "text-anchor": "middle"}, AXIS[this.x]));
    root.append(svg("text", {x: 16, y: (T + H - B) / 2, "text-anchor": "middle", transform: `rotate(-90 16 ${(T + H - B) / 2})`}, AXIS[this.y]));
    const slope = this.y === "rmse" ? -0.5 : -1;
    const level = 0.8 * Math.min(...shown.flatMap(e => e.c.error.map((v, k) => v * e.c[this.x][k] ** -slope)));
    const ends = [Math.min(...xs), Math.max(...xs)].map(v => `${X(v)} ${Y(level * v ** slope)}`);
    root.append(inside);
    inside.append(svg("path", {d: `M${ends.join("L")}`, stroke: "#888", "stroke-dasharray": "5 4", fill: "none", class: "guide"}));
    root.append(svg("text", {x: W - R, y: T + 10, "text-anchor": "end", fill: "#666"}, `dashed: slope ${slope === -1 ? "−1" : "−1/2"}`));
    if (this.y === "rmse" && scene.noise > y0 && scene.noise < y1) {
      root.append(svg("line", {x1: L, x2: W - R, y1: Y(scene.noise), y2: Y(scene.noise), stroke: "#888", "stroke-dasharray": "2 3"}));
      root.append(svg("text", {x: W - R, y: Y(scene.noise) - 4, "text-anchor": "end", fill: "#666"}, "noise of the reference"));
    }
    const points = [];
    for (const {run, i, c} of shown) {
      const at = c.error.map((v, k) => [X(c[this.x][k]), Y(v), k]);
      const banded = at.filter(([, , k]) => c.low[k] !== null);
      if (banded.length > 1)
        inside.append(svg("path", {d: `M${banded.map(([x, , k]) => `${x} ${Y(c.high[k])}`).join("L")}L${banded.reverse().map(([x, , k]) => `${x} ${Y(c.low[k])}`).join("L")}Z`,
                                 fill: this.colour(i), "fill-opacity": 0.15}));
      root.append(svg("path", {d: `M${at.map(([x, y]) => `${x} ${y}`).join("L")}`, fill: "none", stroke: this.colour(i), "stroke-width": 1.8,
                               "stroke-dasharray": this.dash(i), class: "line", "data-run": run}));
      for (const [x, y, k] of at) { root.append(this.marker(i, x, y)); points.push({x, y, run, c, k}); }
    }
    const ring = svg("circle", {r: 8, fill: "none", stroke: "#222", visibility: "hidden"});
    root.append(ring);
    root.addEventListener("pointermove", e => {
      const box = root.getBoundingClientRect(), x = (e.clientX - box.left) * W / box.width, y = (e.clientY - box.top) * H / box.height;
      const p = points.reduce((best, q) => (q.x - x) ** 2 + (q.y - y) ** 2 < (best.x - x) ** 2 + (best.y - y) ** 2 ? q : best);
      ring.setAttribute("cx", p.x);
      ring.setAttribute("cy", p.y);
      ring.setAttribute("visibility", "visible");
      const band = p.c.low[p.k] === null ? "" : ` [${short(p.c.low[p.k])}, ${short(p.c.high[p.k])}]`;
      this.told.textContent = `${p.run}: ${AXIS[this.y]} ${short(p.c.error[p.k])}${band}, ${short(p.c.spp[p.k])} spp, ${short(p.c.seconds[p.k])} s, ${p.c.seeds} seed${p.c.seeds > 1 ? "s" : ""}`;
    });
  }
}
