// The diagram of a campaign: a variable over a swept parameter, or a map over two, growing as points finish.

import { ask, campaignPath } from "./api.js";
import { choice, element, inWords, short, table } from "./dom.js";
import { Plot } from "./plot.js";
import { coloursOf, extent } from "./scale.js";

const PAUSE = 700; // milliseconds between two requests for finished points
const TABLE_ROWS = 200;
const MAP = "map";
const MOST = 12000; // largest number of drawn rows
const DRAW = "draw"; // dimension of randomly drawn points
const CLASS = "class"; // a variable for maps only: its values are names
const MAP_ROOM = 0.25; // margin of requested data around the visible part of a map, relative
const FAILED = ["impact_limit", "error", "crash", "timeout", "unbounded"];
const COLOURS = { up: "one", down: "two", independent: "one" };

export class Diagram {
  /** `picked(run)` is called for a selected point. */
  constructor(id, title, picked, height = 380) {
    Object.assign(this, { id, variable: null, along: null, direction: null, held: {}, levels: {}, within: {}, ended: false });
    this.controls = element("div", { class: "row end" });
    this.said = element("p", { class: "small muted" }, "No points have landed yet.");
    this.plot = new Plot(title, {
      height, picked: (layer, place) => picked(layer.runs[place]), zoomed: (view) => this.zoomed(view),
      words: (layer, place) => this.words(layer, place),
    });
    this.rows = element("div", { class: "scroll tall", tabindex: "0", role: "region", "aria-label": `${title}, as a table` });
    this.details = element("details", { ontoggle: () => this.fillTable() }, element("summary", {}, "As a table"), this.rows);
    this.plot.node.hidden = this.details.hidden = true;
    this.node = element("div", {}, this.controls, this.plot.node, this.said, this.details);
  }

  /** Request the finished points, soon; requests in the meantime are merged. */
  refresh() {
    this.again = true;
    if (this.timer || this.looking) return;
    this.timer = setTimeout(() => this.look(), this.data ? PAUSE : 0);
  }

  close() {
    this.ended = true;
    clearTimeout(this.timer);
  }

  async look() {
    this.timer = null;
    this.again = false;
    this.looking = true;
    try {
      const data = await ask("GET", campaignPath(this.id, `/slice?${this.question()}`));
      if (!this.ended) this.take(data);
    } catch (error) {
      this.said.textContent = error.message;
    } finally {
      this.looking = false;
      if (this.again && !this.ended) this.refresh();
    }
  }

  question() {
    const asked = new URLSearchParams({ most: String(MOST) });
    if (this.variable) asked.set("variable", this.variable);
    for (const [name, value] of Object.entries(this.held)) asked.append("at", `${name}:${value}`);
    for (const [name, [low, high]] of Object.entries(this.within)) asked.append("within", `${name}:${low}:${high}`);
    return asked;
  }

  take(data) {
    const first = !this.data?.variable && data.variable;
    this.data = data;
    if (!data.variable) return;
    this.variable ??= data.variable.name;
    data.axes.forEach((axis, number) => {
      const seen = new Set([...(this.levels[axis.name] ?? []), ...data.coordinates[number]]);
      this.levels[axis.name] = [...seen].filter((value) => value !== null).sort((a, b) => a - b);
    });
    if (first && this.begin(data)) return;
    this.plot.node.hidden = this.details.hidden = !data.axes.length;
    this.showControls();
    this.draw();
  }

  /** Choose the initial view; return whether it needs other values. */
  begin(data) {
    const range = data.variables.find((one) => one.name === "displacement_range");
    const hasMap = spanning(data.axes).length > 1 && (range || !data.variable.along);
    this.along = hasMap ? MAP : data.axes[0]?.name;
    this.variable = hasMap && range ? range.name : data.variable.name;
    this.hold();
    if (!hasMap && !Object.keys(this.held).length) return false;
    this.refresh();
    return true;
  }

  /** Hold the axes that are not shown at values in their middle. */
  hold() {
    const shown = this.along === MAP ? this.mapped().map(placeOf) : this.data.axes.filter((axis) => axis.name === this.along).map(placeOf);
    const others = spanning(this.data.axes).filter((axis) => !shown.includes(placeOf(axis)));
    this.held = Object.fromEntries(others.map(({ name }) => [name, this.held[name] ?? middle(this.levels[name])]));
    this.within = {};
    this.plot.view = null;
  }

  /** Return the two axes of a map; drawn keys count, and zipped keys count as one axis. */
  mapped() {
    const { axes } = this.data, spans = spanning(axes);
    return axes.filter((axis) => axis.along === DRAW || spans.includes(axis)).slice(0, 2);
  }

  change(values) {
    Object.assign(this, values);
    this.hold();
    this.refresh();
  }

  showControls() {
    const { variables, axes, directions, direction } = this.data;
    const state = JSON.stringify([this.variable, this.along, this.held, variables.length, this.levels.length]);
    if (state === this.controlState) return; // keeps an open list open
    this.controlState = state;
    const usable = variables.filter((one) => (this.along === MAP ? !one.along : one.name !== CLASS));
    const made = [choice("Variable", usable.map((one) => [one.name, inWords(one)]), this.variable, (variable) => this.change({ variable }))];
    if (axes.length > 1) {
      const [across, up] = this.mapped();
      const ways = [...(up ? [[MAP, `Map of ${across.label}, ${up.label}`]] : []), ...axes.map((axis) => [axis.name, `Over ${axis.label}`])];
      made.push(choice("Show", ways, this.along, (along) => this.change({ along, variable: this.variableOver(along) })));
    }
    for (const name of Object.keys(this.held)) {
      const axis = axes.find((one) => one.name === name);
      const options = this.levels[name].map((value) => [String(value), short(value)]);
      made.push(choice(inWords(axis), options, String(this.held[name]), (value) => this.change({ held: { ...this.held, [name]: Number(value) } })));
    }
    const ways = [...new Set(direction)];
    if (this.along === MAP && ways.length > 1) {
      this.direction ??= ways[0];
      made.push(choice("Direction", ways.map((way) => [String(way), directions[way]]), String(this.direction), (way) => { this.direction = Number(way); this.draw(); }));
    }
    this.controls.replaceChildren(...made);
  }

  /** Return the next variable to show; some cannot be shown over an axis, or as a map. */
  variableOver(along) {
    if (along === MAP) return this.data.variable.along ? "displacement_range" : this.variable;
    return this.variable === CLASS ? null : this.variable;
  }

  draw() {
    const { axes, rows, shown, every, landed, total, variable } = this.data;
    if (!axes.length) return;
    const content = this.along === MAP ? this.map() : this.branches();
    this.plot.canvas.dataset.points = content.layers.reduce((sum, layer) => sum + layer.xs.length, 0);
    this.plot.show(content);
    const what = every > 1 ? `points, one of ${every} values of each axis,` : "different values";
    const thinned = shown < rows ? `; ${shown} of ${rows} ${what} are drawn, more where you zoom in` : "";
    const nothing = landed && !this.data.value.some((one) => one !== null) ? "; none of them has a value of this variable" : "";
    this.said.textContent = `${inWords(variable)}: ${landed} of ${Math.max(total, landed)} points${nothing}${thinned}.`;
    this.fillTable();
  }

  branches() {
    const { axes, coordinates, value, run, direction, directions, outcome, outcomes, variable } = this.data;
    const number = Math.max(axes.findIndex((axis) => axis.name === this.along), 0);
    const ways = [...new Set(direction)].sort(), size = value.length > 3000 ? 2 : value.length > 400 ? 3 : 4;
    const all = run.map((_, place) => place), failed = all.filter((place) => FAILED.includes(outcomes[outcome[place]]));
    const layer = (colour, name, places) => ({
      kind: "points", size, colour, name,
      xs: places.map((place) => coordinates[number][place]), ys: places.map((place) => value[place]), runs: places.map((place) => run[place]),
    });
    const layers = ways.map((way) => layer(COLOURS[directions[way]], ways.length > 1 ? directions[way] : null,
      all.filter((place) => direction[place] === way && !FAILED.includes(outcomes[outcome[place]]))));
    if (failed.length) layers.push(layer("wrong", "did not come to its end", failed));
    return { layers, x: { label: inWords(axes[number]), log: isLog(coordinates[number]) }, y: { label: inWords(variable) } };
  }

  map() {
    const { axes, classes, coordinates, value, run, direction, variable } = this.data;
    const [across, up] = this.mapped().map((axis) => axes.indexOf(axis));
    const places = run.map((_, place) => place).filter((place) => this.direction === null || direction[place] === this.direction);
    const of = (column) => places.map((place) => column[place]);
    const values = of(value);
    const named = classes.length ? { classes, colours: coloursOf(classes) } : { range: extent([values], 0), bar: inWords(variable) };
    const layer = { kind: isGrid(coordinates[across], coordinates[up], this.data.total) ? "cells" : "nearest", xs: of(coordinates[across]), ys: of(coordinates[up]), values, runs: of(run), ...named };
    return { layers: [layer], x: { label: inWords(axes[across]), log: isLog(coordinates[across]) }, y: { label: inWords(axes[up]), log: isLog(coordinates[up]) } };
  }

  words(layer, place) {
    const { axes, variable } = this.data;
    const [across, up] = this.along === MAP ? this.mapped() : [axes.find((axis) => axis.name === this.along) ?? axes[0], variable];
    const lines = [`${inWords(across)}: ${short(layer.xs[place])}`, `${inWords(up)}: ${short(layer.ys[place])}`];
    if (layer.values) lines.push(`${inWords(variable)}: ${this.told(layer.values[place])}`);
    return [...lines, `point ${layer.runs[place]}${layer.name ? `, ${layer.name}` : ""}`].join("\n");
  }

  /** Return a value in words: the name of a class, or a number. */
  told(value) {
    return this.data.classes[value] ?? short(value);
  }

  zoomed(view) {
    const shown = this.along === MAP ? this.mapped().map((axis) => axis.name) : [this.along];
    const room = this.along === MAP ? MAP_ROOM : 0; // cells outside of a map colour its edge
    const wider = ([low, high]) => [low - room * (high - low), high + room * (high - low)];
    this.within = view ? Object.fromEntries(shown.map((name, place) => [name, wider([view.x, view.y][place])])) : {};
    this.refresh();
  }

  fillTable() {
    if (!this.details.open || !this.data?.variable) return;
    const { axes, coordinates, value, run, direction, directions, outcome, outcomes, variable } = this.data;
    const names = ["Point", ...axes.map(inWords), "Direction", "Outcome", inWords(variable)];
    const rows = run.slice(0, TABLE_ROWS).map((number, place) =>
      [number, ...coordinates.map((column) => column[place]), directions[direction[place]], outcomes[outcome[place]], this.data.classes[value[place]] ?? value[place]]);
    this.rows.replaceChildren(table(`The first ${rows.length} values`, names, rows));
  }
}

function middle(values) {
  return values[Math.floor(values.length / 2)];
}

/** Return the dimension of an axis; axes that vary together, or are drawn, share one. */
function placeOf({ name, along }) {
  return along || name;
}

/** Return the axes that span the sweep, the first one of each group that varies together. */
function spanning(axes) {
  return axes.filter((axis, number) => axes.findIndex((one) => placeOf(one) === placeOf(axis)) === number);
}

/** Whether two coordinates form a grid, some of whose points may be missing yet. */
function isGrid(across, up, total) {
  return new Set(across).size * new Set(up).size <= total;
}

/** Whether values are spaced by equal ratios. */
function isLog(values) {
  const sorted = [...new Set(values)].filter((value) => value !== null).sort((a, b) => a - b);
  if (sorted.length < 4 || sorted[0] <= 0 || sorted.at(-1) < 20 * sorted[0]) return false;
  return sorted[Math.floor(sorted.length / 2)] < 0.7 * (sorted[0] + sorted.at(-1)) / 2;
}
