// A plot on a canvas: zoomed by dragging, keys or buttons; it shows the values under the pointer; points are selectable.

import { button, element, short, tell } from "./dom.js";
import { drawBar, drawLayer, isMap } from "./layers.js";
import { extent, scaleOf } from "./scale.js";

const NEAR = 14; // distance below which the pointer is on a point, pixels
const DRAG = 6; // distance from which on a press is a drag, pixels
const HELP = "Arrow keys go from point to point, Enter opens one, plus and minus zoom, 0 shows all.";

export class Plot {
  /**
   * `label` names the plot; `picked(layer, place)` is called for a selected point; `zoomed(ranges)` after a zoom;
   * `words(layer, place)` is the description of a point.
   */
  constructor(label, { height = 340, picked = null, zoomed = () => {}, words = null } = {}) {
    Object.assign(this, { label, height, picked, zoomed, words: words ?? this.plainWords });
    this.view = null;
    this.beside = [];
    this.content = { layers: [], x: {}, y: {} };
    this.canvas = element("canvas", {
      tabindex: "0", role: "application", "aria-roledescription": "plot", "aria-label": `${label}. ${HELP}`,
      onpointerdown: (event) => this.press(event), onpointermove: (event) => this.move(event),
      onpointerup: (event) => this.release(event), onpointerleave: () => this.point(null),
      ondblclick: () => this.zoomTo(null), onkeydown: (event) => this.key(event),
      onblur: () => this.point(null), onwheel: (event) => this.wheel(event),
    });
    this.canvas.style.height = `${height}px`;
    this.tip = element("div", { class: "tip", hidden: true });
    this.legend = element("div", { class: "legend" });
    this.node = element("div", {},
      element("div", { class: "plot" }, this.canvas, this.tip),
      element("div", { class: "tools" }, this.legend,
        button("+", () => this.zoomBy(0.6), { "aria-label": `Zoom in: ${label}` }),
        button("−", () => this.zoomBy(1 / 0.6), { "aria-label": `Zoom out: ${label}` }),
        button("All", () => this.zoomTo(null), { "aria-label": `Show all: ${label}` })));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /** Show layers `{kind, xs, ys, colour, name}` over axes `{label, log}`; a map has `values`, `range` and `bar`. */
  show(content) {
    this.content = content;
    const named = content.layers.filter((layer) => layer.name), map = content.layers.find((layer) => layer.classes);
    this.legend.replaceChildren(...named.map((layer) =>
      element("span", {}, element("span", { class: `key ${layer.colour}` }), layer.name)), ...(map ? namesOf(map) : []));
    for (const one of [this, ...this.beside]) one.draw();
  }

  /** Ranges of the axes: the zoom, else the full range of this plot and of the linked ones. */
  get ranges() {
    if (this.view) return this.view;
    const all = [this, ...this.alike].map((one) => one.extents);
    return { x: extent(all.map(({ x }) => x), 0), y: extent(all.map(({ y }) => y), 0) };
  }

  /** Linked plots, which show the same quantities. */
  get alike() {
    const { x, y } = this.content;
    return this.beside.filter(({ content }) => content.x.label === x.label && content.y.label === y.label);
  }

  get extents() {
    const { layers, x, y } = this.content;
    const room = layers.some(isMap) ? 0 : 0.04;
    const limits = layers.filter((layer) => layer.kind === "limits");
    const ys = [...layers.map((layer) => layer.ys), ...limits.map(({ at, across }) => (across ? at : []))];
    const xs = [...layers.map((layer) => layer.xs), ...limits.map(({ at, across }) => (across ? [] : at))];
    if (layers.some((layer) => layer.kind === "stems")) ys.push([0]);
    return { x: extent(xs, room || 0.01, x.log), y: extent(ys, room || 0.01, y.log) };
  }

  /** Link this plot with others that show the same quantities: they share axes and zoom. */
  share(others) {
    this.beside = others;
    this.draw();
  }

  draw() {
    const width = this.canvas.clientWidth, height = this.height, dense = window.devicePixelRatio || 1;
    if (!width) return;
    this.canvas.width = width * dense;
    this.canvas.height = height * dense;
    const pen = this.canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    pen.scale(dense, dense);
    pen.font = '12px system-ui, "DejaVu Sans", sans-serif';
    const map = this.content.layers.find((layer) => isMap(layer) && !layer.classes);
    const { x, y } = this.ranges;
    const box = this.box = { left: 62, right: width - (map ? 96 : 12), top: 10, bottom: height - 42 };
    this.x = scaleOf(x[0], x[1], box.left, box.right, this.content.x.log);
    this.y = scaleOf(y[0], y[1], box.bottom, box.top, this.content.y.log);
    this.frame(pen, colour);
    pen.save();
    pen.beginPath();
    pen.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
    pen.clip();
    for (const layer of this.content.layers) drawLayer(pen, layer, this.x, this.y, colour(NAMES[layer.colour] ?? NAMES.one), box);
    this.marks(pen, colour);
    pen.restore();
    if (map) drawBar(pen, map.range, map.bar, box.right + 10, box.top, box.bottom - box.top, colour("--muted"), (value) => short(Number(value.toPrecision(3))));
  }

  frame(pen, colour) {
    const { left, right, top, bottom } = this.box;
    pen.fillStyle = colour("--sunk");
    pen.fillRect(left, top, right - left, bottom - top);
    pen.strokeStyle = colour("--grid");
    pen.fillStyle = colour("--muted");
    pen.textAlign = "center";
    pen.textBaseline = "top";
    for (const value of this.x.ticks(Math.max(3, (right - left) / 75))) {
      const place = this.x.place(value);
      line(pen, place, top, place, bottom);
      pen.fillText(short(value), place, bottom + 6);
    }
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const value of this.y.ticks(6)) {
      const place = this.y.place(value);
      line(pen, left, place, right, place);
      pen.fillText(short(value), left - 6, place);
    }
    pen.fillStyle = colour("--text");
    pen.textAlign = "center";
    pen.fillText(this.content.x.label ?? "", (left + right) / 2, bottom + 32, right - left);
    pen.save();
    pen.translate(12, (top + bottom) / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(this.content.y.label ?? "", 0, 0, bottom - top);
    pen.restore();
  }

  /** Draw the selected point, and the box being dragged. */
  marks(pen, colour) {
    for (const one of [this.chosen, this.pointed]) {
      const layer = one && this.content.layers[one.layer];
      if (!layer || one.place >= layer.xs.length) continue;
      pen.beginPath();
      pen.arc(this.x.place(layer.xs[one.place]), this.y.place(layer.ys[one.place]), 6, 0, 7);
      for (const [name, wide] of [["--raised", 5], ["--text", 2]]) { // two strokes are visible on any colour
        pen.strokeStyle = colour(name);
        pen.lineWidth = wide;
        pen.stroke();
      }
    }
    pen.strokeStyle = colour("--text");
    if (!this.drag?.moved) return;
    const { from, to } = this.drag;
    pen.lineWidth = 1;
    pen.strokeRect(from[0], from[1], to[0] - from[0], to[1] - from[1]);
  }

  nearest([across, up], far = NEAR) {
    let found = null, best = far * far;
    this.content.layers.forEach((layer, number) => {
      if (layer.kind === "line" && !layer.readable) return;
      if (isMap(layer) && this.isInside(across, up)) best = Infinity;
      for (let place = 0; place < layer.xs.length; place++) {
        if (layer.xs[place] === null || layer.ys[place] === null) continue;
        const aside = this.x.place(layer.xs[place]) - across, above = this.y.place(layer.ys[place]) - up;
        const distance = aside * aside + above * above;
        if (distance < best) { best = distance; found = { layer: number, place }; }
      }
    });
    return found;
  }

  isInside(across, up) {
    const { left, right, top, bottom } = this.box;
    return across >= left && across <= right && up >= top && up <= bottom;
  }

  point(found, aloud = false) {
    const same = this.pointed?.layer === found?.layer && this.pointed?.place === found?.place;
    this.pointed = found;
    this.tip.hidden = !found;
    this.canvas.classList.toggle("pointing", Boolean(found && this.picked));
    if (found) {
      const layer = this.content.layers[found.layer], text = this.words(layer, found.place);
      const across = this.x.place(layer.xs[found.place]), up = this.y.place(layer.ys[found.place]);
      this.tip.textContent = text;
      this.tip.style.left = `${Math.min(across + 12, this.canvas.clientWidth - this.tip.offsetWidth - 4)}px`;
      this.tip.style.top = `${Math.max(up - this.tip.offsetHeight - 10, 0)}px`;
      if (aloud) tell(text);
    }
    if (!same) this.draw();
  }

  plainWords(layer, place) {
    return `${this.content.x.label}: ${short(layer.xs[place])}\n${this.content.y.label}: ${short(layer.ys[place])}`;
  }

  pick() {
    if (!this.pointed || !this.picked) return;
    this.chosen = this.pointed;
    this.picked(this.content.layers[this.chosen.layer], this.chosen.place);
    this.draw();
  }

  // ---- pointer and keys ----

  press(event) {
    if (event.button) return;
    this.drag = { from: [event.offsetX, event.offsetY], to: [event.offsetX, event.offsetY], moved: false };
    if (event.pointerType === "mouse") this.canvas.setPointerCapture(event.pointerId);
  }

  move(event) {
    const place = [event.offsetX, event.offsetY];
    if (!this.drag || event.pointerType !== "mouse") return this.point(this.nearest(place));
    this.drag.to = place;
    this.drag.moved ||= Math.hypot(place[0] - this.drag.from[0], place[1] - this.drag.from[1]) > DRAG;
    this.draw();
  }

  release(event) {
    const drag = this.drag;
    this.drag = null;
    if (!drag?.moved) {
      this.point(this.nearest([event.offsetX, event.offsetY], event.pointerType === "mouse" ? NEAR : 2 * NEAR));
      return this.pick();
    }
    const sides = (scale, place) => [scale.value(drag.from[place]), scale.value(drag.to[place])].sort((a, b) => a - b);
    this.zoomTo({ x: sides(this.x, 0), y: sides(this.y, 1) });
  }

  wheel(event) {
    if (!event.ctrlKey && !event.metaKey) return; // the event scrolls the page
    event.preventDefault();
    this.zoomBy(event.deltaY > 0 ? 1.25 : 0.8, [event.offsetX, event.offsetY]);
  }

  key(event) {
    const acts = {
      ArrowRight: () => this.step(1), ArrowDown: () => this.step(1), ArrowLeft: () => this.step(-1), ArrowUp: () => this.step(-1),
      Enter: () => this.pick(), "+": () => this.zoomBy(0.6), "=": () => this.zoomBy(0.6), "-": () => this.zoomBy(1 / 0.6),
      0: () => this.zoomTo(null), Escape: () => this.point(null),
    };
    if (!acts[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    acts[event.key]();
  }

  step(way) {
    const places = this.content.layers.flatMap((layer, number) => (layer.kind === "line" && !layer.readable ? [] : layer.xs
      .map((_, place) => ({ layer: number, place })).filter(({ place }) => layer.xs[place] !== null && layer.ys[place] !== null)));
    const now = places.findIndex((one) => one.layer === this.pointed?.layer && one.place === this.pointed.place);
    const next = places[now < 0 ? 0 : now + way];
    if (next) this.point(next, true);
  }

  zoomBy(factor, around) {
    const middle = around ?? [(this.box.left + this.box.right) / 2, (this.box.top + this.box.bottom) / 2];
    const part = (scale, from, to, at) => [scale.value(at + (from - at) * factor), scale.value(at + (to - at) * factor)];
    const { left, right, top, bottom } = this.box;
    this.zoomTo({ x: part(this.x, left, right, middle[0]), y: part(this.y, bottom, top, middle[1]) });
  }

  zoomTo(view) {
    for (const one of [this, ...this.alike]) {
      one.view = view;
      one.draw();
      one.zoomed(view);
    }
  }
}

/** Return the legend of a map of classes; classes of the same colour share an entry. */
function namesOf({ classes, colours }) {
  return [...new Set(colours)].map((colour) => {
    const key = element("span", { class: "key" }), same = classes.filter((_, place) => colours[place] === colour);
    key.style.backgroundColor = colour;
    return element("span", {}, key, same.length > 1 ? `${same.length} others` : same[0]);
  });
}

const NAMES = { one: "--series-1", two: "--series-2", three: "--series-3", wrong: "--bad", limit: "--text" };

function line(pen, left, top, right, bottom) {
  pen.beginPath();
  pen.moveTo(left, top);
  pen.lineTo(right, bottom);
  pen.stroke();
}
