// What a plot is drawn of: points, lines, stems and the cells of a map, each on a canvas between two scales.

import { colourOf } from "./scale.js";

export function drawLayer(pen, layer, x, y, colour) {
  pen.fillStyle = pen.strokeStyle = colour;
  DRAWN[layer.kind](pen, layer, x, y);
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
  cells(pen, { xs, ys, values, range }, x, y) {
    const across = edgesOf(xs, x.logarithmic), up = edgesOf(ys, y.logarithmic);
    for (let place = 0; place < xs.length; place++) {
      if (values[place] === null) continue;
      pen.fillStyle = colourOf((values[place] - range[0]) / (range[1] - range[0]));
      const [left, right] = across.get(xs[place]).map(x.place), [below, above] = up.get(ys[place]).map(y.place);
      pen.fillRect(left, above, right - left + 0.6, below - above + 0.6);
    }
  },
};

/** Return of each value how far its cell reaches: half of the way to its neighbours. */
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

/** Draw the bar that says which colour is which value. */
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
