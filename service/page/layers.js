// Layers of a plot: points, lines, stems and the cells of a map, each drawn on a canvas between two scales.

import { colourOf } from "./scale.js";

const GRAIN = 2; // size of a cell in a map of scattered points, pixels

/** Draw one layer between the scales `x` and `y`, in the box of the plot. */
export function drawLayer(pen, layer, x, y, colour, box) {
  pen.fillStyle = pen.strokeStyle = colour;
  DRAWN[layer.kind](pen, layer, x, y, box);
}

/** Whether a layer is a map, with a value at every place. */
export function isMap({ kind }) {
  return kind === "cells" || kind === "nearest";
}

/** Return columns with a gap at each instant, before its first `time` (ascending), so that no line crosses a jump. */
export function withGaps(columns, time, instants = []) {
  const jumps = new Set(instants.map((instant) => time.findIndex((one) => one >= instant)).filter((place) => place > 0));
  return columns.map((column) => column.flatMap((value, place) => (jumps.has(place) ? [null, value] : [value])));
}

const DRAWN = {
  points(pen, { xs, ys, size = 3 }, x, y) {
    for (let place = 0; place < xs.length; place++) {
      if (xs[place] === null || ys[place] === null) continue;
      pen.fillRect(x.place(xs[place]) - size / 2, y.place(ys[place]) - size / 2, size, size);
    }
  },
  line(pen, { xs, ys }, x, y) {
    pen.lineWidth = 1.4;
    pen.beginPath();
    let lifted = true;
    for (let place = 0; place < xs.length; place++) {
      if (xs[place] === null || ys[place] === null) { lifted = true; continue; }
      if (lifted) pen.moveTo(x.place(xs[place]), y.place(ys[place]));
      else pen.lineTo(x.place(xs[place]), y.place(ys[place]));
      lifted = false;
    }
    pen.stroke();
  },
  /** Lines across the whole plot, at values of one of its axes. */
  limits(pen, { at, across }, x, y, box) {
    pen.lineWidth = 1.2;
    pen.setLineDash([6, 4]);
    pen.beginPath();
    for (const value of at) {
      const place = (across ? y : x).place(value);
      pen.moveTo(across ? box.left : place, across ? place : box.top);
      pen.lineTo(across ? box.right : place, across ? place : box.bottom);
    }
    pen.stroke();
    pen.setLineDash([]);
  },
  stems(pen, { xs, ys }, x, y) {
    pen.lineWidth = 1.2;
    for (let place = 0; place < xs.length; place++) {
      if (xs[place] === null || ys[place] === null) continue;
      const [across, up] = [x.place(xs[place]), y.place(ys[place])];
      pen.beginPath();
      pen.moveTo(across, y.place(0));
      pen.lineTo(across, up);
      pen.stroke();
      pen.beginPath();
      pen.arc(across, up, 2.6, 0, 7);
      pen.fill();
    }
  },
  /** Colour each place as the nearest point: the first of two passes looks up and left, the second down and right. */
  nearest(pen, layer, x, y, box) {
    const { xs, ys, values } = layer;
    const wide = Math.ceil((box.right - box.left) / GRAIN), tall = Math.ceil((box.bottom - box.top) / GRAIN);
    const across = xs.map((value) => (x.place(value) - box.left) / GRAIN), up = ys.map((value) => (y.place(value) - box.top) / GRAIN);
    const owner = new Int32Array(wide * tall).fill(-1);
    const clip = (place, count) => Math.min(Math.max(Math.floor(place), 0), count - 1);
    const consider = (column, row, one) => {
      if (one < 0) return;
      const cell = row * wide + column, other = owner[cell];
      const far = (which) => (across[which] - column - 0.5) ** 2 + (up[which] - row - 0.5) ** 2;
      if (other < 0 || far(one) < far(other)) owner[cell] = one;
    };
    values.forEach((value, one) => { if (value !== null) consider(clip(across[one], wide), clip(up[one], tall), one); });
    for (const [first, last, step] of [[0, wide * tall, 1], [wide * tall - 1, -1, -1]]) {
      for (let cell = first; cell !== last; cell += step) {
        const column = cell % wide, row = (cell - column) / wide;
        for (const [aside, above] of [[step, 0], [-step, step], [0, step], [step, step]]) {
          if (column - aside < 0 || column - aside >= wide || row - above < 0 || row - above >= tall) continue;
          consider(column, row, owner[cell - above * wide - aside]);
        }
      }
    }
    for (let cell = 0; cell < owner.length; cell++) {
      if (owner[cell] < 0) continue;
      const column = cell % wide;
      pen.fillStyle = cellColour(layer, owner[cell]);
      pen.fillRect(box.left + column * GRAIN, box.top + ((cell - column) / wide) * GRAIN, GRAIN, GRAIN);
    }
  },
  cells(pen, layer, x, y) {
    const { xs, ys, values } = layer;
    const across = edgesOf(xs, x.logarithmic), up = edgesOf(ys, y.logarithmic);
    for (let place = 0; place < xs.length; place++) {
      if (values[place] === null) continue;
      pen.fillStyle = cellColour(layer, place);
      const [left, right] = across.get(xs[place]).map(x.place), [below, above] = up.get(ys[place]).map(y.place);
      pen.fillRect(left, above, right - left + 0.6, below - above + 0.6);
    }
  },
};

/** Return the colour of a cell of a map, by its class or its value. */
function cellColour({ values, colours, range }, place) {
  return colours ? colours[values[place]] : colourOf((values[place] - range[0]) / (range[1] - range[0]));
}

/** Return the extent of each value's cell: half of the distance to its neighbours. */
function edgesOf(values, logarithmic) {
  const sorted = [...new Set(values)].filter((value) => value !== null).sort((a, b) => a - b);
  const middle = logarithmic ? (a, b) => Math.sqrt(a * b) : (a, b) => (a + b) / 2;
  const beyond = logarithmic ? (a, b) => (a * a) / b : (a, b) => 2 * a - b;
  return new Map(sorted.map((value, place) => {
    const before = sorted[place - 1], after = sorted[place + 1];
    const outer = (near) => (near === undefined ? value : beyond(value, middle(value, near)));
    const low = before === undefined ? outer(after) : middle(before, value);
    const high = after === undefined ? outer(before) : middle(value, after);
    return [value, low === high ? [value - 0.5, value + 0.5] : [low, high]];
  }));
}

/** Draw the colour bar. */
export function drawBar(pen, range, label, left, top, height, text, words) {
  for (let place = 0; place < height; place++) {
    pen.fillStyle = colourOf(1 - place / height);
    pen.fillRect(left, top + place, 12, 1.5);
  }
  pen.fillStyle = text;
  pen.textAlign = "left";
  pen.textBaseline = "middle";
  for (const share of [0, 0.5, 1]) {
    pen.fillText(words(range[0] + share * (range[1] - range[0])), left + 17, top + height * (1 - share));
  }
  pen.save();
  pen.translate(left + 74, top + height / 2);
  pen.rotate(-Math.PI / 2);
  pen.textAlign = "center";
  pen.fillText(label, 0, 0);
  pen.restore();
}
