// Flip-book of one scene: images replace each other in place, or stand side by side; zoom, pan and exposure are those of all of them.
"use strict";

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The 65536 half floats (IEEE 754 binary16) as numbers.
const HALF = new Float32Array(65536);
for (let i = 0; i < 65536; ++i) {
  const sign = i & 0x8000 ? -1 : 1, exponent = (i >> 10) & 31, mantissa = i & 1023;
  HALF[i] = sign * (exponent === 31 ? (mantissa ? NaN : Infinity)
                    : exponent ? 2 ** (exponent - 15) * (1 + mantissa / 1024) : 2 ** -14 * (mantissa / 1024));
}

// Inverse of hdr_data.py: three planes of floats, R, G, B one after the other.
async function decodeImage(text) {
  const raw = await inflate(text), n = raw.length / 2, out = new Float32Array(n);
  for (let i = 0; i < n; ++i) out[i] = HALF[raw[i] | (raw[n + i] << 8)];
  return out;
}

// sRGB (IEC 61966-2-1) of a linear value, 8 bits; the table has a step below half of the smallest step in sRGB.
const SRGB = new Uint8ClampedArray(8193);
for (let i = 0; i < SRGB.length; ++i) {
  const x = i / 8192;
  SRGB[i] = Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
}

const MODES = {
  image: "image", relative: "relative error |x − r| / (|r| + 0.01)", signed: "signed error (x − r) / (|r| + 0.01)", flip: "HDR-FLIP",
};

class Viewer {
  constructor(element, scene, colours) {
    this.element = element;
    this.scene = scene;          // {name, width, height, exposure, reference, images: [{name, data, flip}], scale, shrunk}
    this.colours = colours;      // {error: [[r, g, b]...], signed: [[r, g, b]...]} of 256 each
    this.stops = 0;
    this.mode = "image";
    this.current = 0;
    this.before = 0;
    this.side = false;
    this.zoom = 1;               // 1: the whole image fits
    this.centre = [scene.width / 2, scene.height / 2];
    this.maximum = scene.scale;  // of the error maps' colour scale
    this.pixels = new Map();     // what an image looks like now: "index" -> canvas of the image's size
    this.reference = scene.images.findIndex(i => i.reference);
  }

  async start() {
    for (const image of this.scene.images) {
      image.values = await decodeImage(image.data);
      if (image.flip) image.map = await inflate(image.flip);
    }
    this.build();
    this.layout();
    this.element.dataset.ready = "yes";
  }

  // --- controls ---
  build() {
    const make = (tag, attributes = {}, text = "") => Object.assign(document.createElement(tag), attributes, text ? {textContent: text} : {});
    this.tabs = make("div", {className: "tabs"});
    this.tabs.setAttribute("role", "group");
    this.scene.images.forEach((image, i) => {
      const button = make("button", {type: "button", title: i < 9 ? `key ${i + 1}` : ""}, image.name);
      button.onclick = () => this.show(i);
      this.tabs.append(button);
    });
    const controls = make("div", {className: "controls"});
    const modes = make("select", {className: "mode"});
    for (const [key, name] of Object.entries(MODES)) {
      const possible = key === "image" || (key === "flip" ? this.scene.images.some(i => i.map) : this.reference >= 0);
      if (possible) modes.append(make("option", {value: key}, name));
    }
    modes.onchange = () => { this.mode = modes.value; this.redraw(); };
    const side = make("button", {type: "button", className: "side"}, "side by side");
    side.onclick = () => { this.side = !this.side; this.layout(); };
    const fit = make("button", {type: "button", className: "fit"}, "whole image");
    fit.onclick = () => { this.zoom = 1; this.centre = [this.scene.width / 2, this.scene.height / 2]; this.draw(); };
    const exposure = make("input", {type: "range", min: -8, max: 8, step: 0.25, value: 0, className: "exposure"});
    exposure.setAttribute("aria-label", "exposure in stops");
    this.exposureText = make("span", {}, "0 stops");
    exposure.oninput = () => { this.stops = Number(exposure.value); this.redraw(); };
    const reset = make("button", {type: "button"}, "0");
    reset.onclick = () => { exposure.value = 0; exposure.oninput(); };
    const label = make("label", {}, "exposure ");
    label.append(exposure, this.exposureText, reset);
    this.exposureLabel = label;
    const scale = make("input", {type: "range", min: -6, max: 6, step: 0.25, value: 0, className: "scale"});
    scale.setAttribute("aria-label", "greatest error of the colour scale");
    scale.oninput = () => { this.maximum = this.scene.scale * 2 ** Number(scale.value); this.redraw(); };
    this.scaleLabel = make("label", {}, "colours end at ");
    this.scaleText = make("span");
    this.scaleLabel.append(scale, this.scaleText);
    controls.append(modes, label, this.scaleLabel, side, fit);
    this.sideButton = side;
    this.legend = make("div", {className: "note"});
    this.views = make("div", {className: "views"});
    this.readout = make("div", {className: "readout"});
    this.element.append(this.tabs, controls, this.views, this.readout, this.legend);
    this.element.tabIndex = -1;
    this.element.addEventListener("keydown", e => this.key(e));
  }

  key(e) {
    if (e.ctrlKey || e.metaKey || e.altKey || /INPUT|SELECT/.test(e.target.tagName)) return;
    const n = this.scene.images.length, digit = Number(e.key);
    if (digit >= 1 && digit <= n) this.show(digit - 1);
    else if (e.key === "ArrowRight") this.show((this.current + 1) % n);
    else if (e.key === "ArrowLeft") this.show((this.current + n - 1) % n);
    else if (e.key === "f") this.show(this.before);
    else return;
    e.preventDefault();
  }

  show(i) {
    if (i !== this.current) this.before = this.current;
    this.current = i;
    this.draw();
  }

  // --- canvases ---
  layout() {
    const count = this.side ? this.scene.images.length : 1;
    const room = this.element.clientWidth || 1100;
    const across = this.side ? Math.max(1, Math.min(count, Math.floor(room / 330))) : 1;
    const {width, height} = this.scene;
    let w = Math.floor((room - 8 * (across - 1)) / across);
    w = Math.min(w, Math.floor(640 * width / height), this.side ? w : Math.max(900, width));
    const h = Math.round(w * height / width), ratio = window.devicePixelRatio || 1;
    this.views.replaceChildren();
    this.canvases = [];
    for (let i = 0; i < count; ++i) {
      const view = document.createElement("div"), canvas = document.createElement("canvas"), name = document.createElement("span");
      view.className = "view";
      name.className = "name";
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
      canvas.style.width = `${w}px`;
      canvas.style.height = `${h}px`;
      canvas.tabIndex = 0;
      this.listen(canvas);
      view.append(canvas, name);
      this.views.append(view);
      this.canvases.push({canvas, name});
    }
    this.redraw();
  }

  listen(canvas) {
    canvas.addEventListener("wheel", e => {
      e.preventDefault();
      this.zoomAt(canvas, e, Math.exp(-0.0016 * e.deltaY));
    }, {passive: false});
    canvas.addEventListener("dblclick", e => this.zoomAt(canvas, e, 2));
    let last = null;
    canvas.addEventListener("pointerdown", e => { last = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); canvas.focus({preventScroll: true}); });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { last = null; });
    canvas.addEventListener("pointermove", e => {
      if (last) {
        const s = this.scaleOf(canvas) / (window.devicePixelRatio || 1);
        this.centre = [this.centre[0] - (e.clientX - last[0]) / s, this.centre[1] - (e.clientY - last[1]) / s];
        last = [e.clientX, e.clientY];
        this.draw();
      }
      this.tell(canvas, e);
    });
  }

  // Canvas pixels per image pixel.
  scaleOf(canvas) { return this.zoom * Math.min(canvas.width / this.scene.width, canvas.height / this.scene.height); }

  // Image coordinates under a mouse event.
  at(canvas, e) {
    const box = canvas.getBoundingClientRect(), s = this.scaleOf(canvas);
    return [0, 1].map(k => {
      const size = k ? canvas.height : canvas.width, place = k ? (e.clientY - box.top) / box.height : (e.clientX - box.left) / box.width;
      return this.centre[k] + (place - 0.5) * size / s;
    });
  }

  zoomAt(canvas, e, factor) {
    const fixed = this.at(canvas, e), zoom = Math.min(64, Math.max(1, this.zoom * factor)), change = this.zoom / zoom;
    this.centre = this.centre.map((c, k) => fixed[k] + (c - fixed[k]) * change);
    this.zoom = zoom;
    this.draw();
  }

  keepInside() {
    const size = [this.scene.width, this.scene.height];
    this.centre = this.centre.map((c, k) => Math.min(size[k] - size[k] / 2 / this.zoom, Math.max(size[k] / 2 / this.zoom, c)));
  }

  // --- from values to colours ---
  redraw() {
    this.pixels.clear();
    this.exposureText.textContent = `${this.stops > 0 ? "+" : ""}${this.stops} stops`;
    this.exposureLabel.style.display = this.mode === "image" ? "" : "none";
    this.scaleText.textContent = this.maximum.toPrecision(3);
    this.scaleLabel.hidden = this.mode === "image" || this.mode === "flip";
    this.scaleLabel.style.display = this.scaleLabel.hidden ? "none" : "";
    const end = this.mode === "flip" ? 1 : this.maximum, colours = this.mode === "signed" ? this.colours.signed : this.colours.error;
    const gradient = [0, 32, 64, 96, 128, 160, 192, 224, 255].map(i => `rgb(${colours[i].join(",")})`).join(",");
    this.legend.innerHTML = this.mode === "image" ? `Shown at ${(this.scene.exposure * 2 ** this.stops).toPrecision(3)} times the radiance, sRGB; NaN is magenta.`
      : `${this.mode === "signed" ? "−" + end.toPrecision(2) : "0"}<span class="bar" style="background:linear-gradient(to right,${gradient})"></span>${end.toPrecision(2)}`;
    this.draw();
  }

  colour(index) {
    if (this.pixels.has(index)) return this.pixels.get(index);
    const {width, height} = this.scene, n = width * height, image = this.scene.images[index];
    const canvas = document.createElement("canvas");
    canvas.width = width;
    canvas.height = height;
    const context = canvas.getContext("2d"), data = context.createImageData(width, height), out = data.data, x = image.values;
    const map = this.mode === "image" || (this.mode === "flip" && !image.map) ? null : this.errors(index);
    if (map) {
      const colours = this.mode === "signed" ? this.colours.signed : this.colours.error;
      for (let i = 0; i < n; ++i) {
        const v = Number.isFinite(map[i]) ? map[i] : 1;
        const c = colours[Math.max(0, Math.min(255, Math.round(255 * (this.mode === "signed" ? 0.5 + 0.5 * v : v))))];
        out[4 * i] = c[0]; out[4 * i + 1] = c[1]; out[4 * i + 2] = c[2]; out[4 * i + 3] = 255;
      }
    } else if (this.mode === "flip") {
      out.fill(128);  // the reference, or no map
    } else {
      const factor = this.scene.exposure * 2 ** this.stops * 8192;
      for (let i = 0; i < n; ++i) {
        const r = x[i], g = x[n + i], b = x[2 * n + i], good = Number.isFinite(r + g + b);
        out[4 * i] = good ? SRGB[Math.max(0, Math.min(8192, Math.round(r * factor)))] : 255;
        out[4 * i + 1] = good ? SRGB[Math.max(0, Math.min(8192, Math.round(g * factor)))] : 0;
        out[4 * i + 2] = good ? SRGB[Math.max(0, Math.min(8192, Math.round(b * factor)))] : 255;
        out[4 * i + 3] = 255;
      }
    }
    context.putImageData(data, 0, 0);
    this.pixels.set(index, canvas);
    return canvas;
  }

  // Errors of an image as shares of the colour scale, mean of the channels (images.py).
  errors(index) {
    const n = this.scene.width * this.scene.height, out = new Float32Array(n);
    if (this.mode === "flip") {
      const map = this.scene.images[index].map;
      for (let i = 0; i < n; ++i) out[i] = map[i] / 255;
      return out;
    }
    const x = this.scene.images[index].values, r = this.scene.images[this.reference].values, signed = this.mode === "signed";
    for (let i = 0; i < n; ++i) {
      let sum = 0;
      for (let c = 0; c < 3; ++c) {
        const d = x[c * n + i] - r[c * n + i];
        sum += (signed ? d : Math.abs(d)) / (Math.abs(r[c * n + i]) + 0.01);
      }
      out[i] = sum / 3 / this.maximum;
    }
    return out;
  }

  draw() {
    this.keepInside();
    this.sideButton.setAttribute("aria-pressed", this.side);
    [...this.tabs.children].forEach((b, i) => b.setAttribute("aria-pressed", i === this.current));
    this.canvases.forEach(({canvas, name}, i) => {
      const index = this.side ? i : this.current, context = canvas.getContext("2d"), s = this.scaleOf(canvas);
      name.textContent = this.scene.images[index].name;
      canvas.classList.toggle("zoomed", this.zoom > 1);  // only then a finger moves the image and not the page
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.clearRect(0, 0, canvas.width, canvas.height);
      context.imageSmoothingEnabled = s < 1;
      context.setTransform(s, 0, 0, s, canvas.width / 2 - s * this.centre[0], canvas.height / 2 - s * this.centre[1]);
      context.drawImage(this.colour(index), 0, 0);
    });
    // What tests and other scripts look at.
    Object.assign(this.element.dataset, {zoom: this.zoom.toFixed(4), centre: this.centre.map(c => c.toFixed(3)).join(","), current: this.current});
  }

  // Values under the mouse.
  tell(canvas, e) {
    const [x, y] = this.at(canvas, e).map(Math.floor), {width, height} = this.scene, n = width * height;
    if (x < 0 || y < 0 || x >= width || y >= height) { this.readout.textContent = ""; return; }
    const one = index => [0, 1, 2].map(c => this.scene.images[index].values[c * n + y * width + x].toPrecision(4)).join(" ");
    const own = this.side ? this.canvases.findIndex(v => v.canvas === canvas) : this.current;
    this.readout.textContent = `(${x}, ${y})  ${this.scene.images[own].name}: ${one(own)}` + (this.reference >= 0 && own !== this.reference ? `   reference: ${one(this.reference)}` : "");
  }
}
