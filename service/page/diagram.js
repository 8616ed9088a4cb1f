// The diagram of a campaign: a variable over a swept parameter, or a map over two, growing while points land.

import { ask, campaignPath } from "./api.js";
import { choice, element, inWords, short, table } from "./dom.js";
import { Plot } from "./plot.js";
import { extent } from "./scale.js";

const PAUSE = 700; // milliseconds between two looks at what has landed
const TABLE_ROWS = 200;
const MAP = "map";
const MAP_ROOM = 0.25; // part of what is shown of a map that is asked for beside it
const FAILED = ["impact_limit", "error", "crash", "timeout"];
const COLOURS = { up: "one", down: "two", independent: "one" };

export class Diagram {
  /** `picked(run)` is called for a point that was chosen. */
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

  /** Look at what has landed, soon; looks that are asked for meanwhile become one. */
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
    const asked = new URLSearchParams({ most: "6000" });
    if (this.variable) asked.set("variable", this.variable);
    for (const [name, value] of Object.entries(this.held)) asked.append("at", `${name}:${value}`);
    for (const [name, [low, high]] of Object.entries(this.within)) asked.append("within", `${name}:${low}:${high}`);
    return asked;
  }

  take(data) {
    const first = !this.data?.variable && data.variable;
    this.data = data;
    if (!data.variable) return;
    data.axes.forEach((axis, number) => {
      const seen = new Set([...(this.levels[axis.name] ?? []), ...data.coordinates[number]]);
      this.levels[axis.name] = [...seen].filter((value) => value !== null).sort((a, b) => a - b);
    });
    if (first && this.begin(data)) return;
    this.plot.node.hidden = this.details.hidden = !data.axes.length;
    this.showControls();
    this.draw();
  }

  /** Choose what is shown at first; return whether that asks for other values. */
  begin(data) {
    const several = data.axes.length > 1;
    const range = data.variables.find((one) => one.name === "displacement_range");
    const hasMap = several && !movesTogether(data) && (range || !data.variable.along);
    this.along = hasMap ? MAP : data.axes[0]?.name;
    this.variable = hasMap && range ? range.name : data.variable.name;
    this.hold();
    if (!hasMap && !Object.keys(this.held).length) return false;
    this.refresh();
    return true;
  }

  /** Hold the axes that are not shown at values in their middle. */
  hold() {
    const shown = this.along === MAP ? this.data.axes.slice(0, 2).map((axis) => axis.name) : [this.along];
    const others = movesTogether(this.data) ? [] : this.data.axes.filter((axis) => !shown.includes(axis.name));
    this.held = Object.fromEntries(others.map(({ name }) => [name, this.held[name] ?? middle(this.levels[name])]));
    this.within = {};
    this.plot.view = null;
  }

  change(values) {
    Object.assign(this, values);
    this.hold();
    this.refresh();
  }

  showControls() {
    const { variables, axes, directions, direction } = this.data;
    const state = JSON.stringify([this.variable, this.along, this.held, variables.length, this.levels.length]);
    if (state === this.controlState) return; // a list that is open stays open
    this.controlState = state;
    const usable = variables.filter((one) => this.along !== MAP || !one.along);
    const made = [choice("Variable", usable.map((one) => [one.name, inWords(one)]), this.variable, (variable) => this.change({ variable }))];
    if (axes.length > 1) {
      const ways = [[MAP, `Map of ${axes[0].label}, ${axes[1].label}`], ...axes.map((axis) => [axis.name, `Over ${axis.label}`])];
      made.push(choice("Show", ways, this.along, (along) => this.change({ along, variable: along === MAP && this.data.variable.along ? "displacement_range" : this.variable })));
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

  draw() {
    const { axes, rows, shown, landed, total, variable } = this.data;
    if (!axes.length) return;
    const content = this.along === MAP ? this.map() : this.branches();
    this.plot.canvas.dataset.points = content.layers.reduce((sum, layer) => sum + layer.xs.length, 0);
    this.plot.show(content);
    const thinned = shown < rows ? `; ${shown} of ${rows} different values are drawn, more where you zoom in` : "";
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
    const { axes, coordinates, value, run, direction, variable } = this.data;
    const places = run.map((_, place) => place).filter((place) => this.direction === null || direction[place] === this.direction);
    const of = (column) => places.map((place) => column[place]);
    const values = of(value);
    const layer = { kind: isGrid(this.data) ? "cells" : "nearest", xs: of(coordinates[0]), ys: of(coordinates[1]), values, runs: of(run), range: extent([values], 0), bar: inWords(variable) };
    return { layers: [layer], x: { label: inWords(axes[0]), log: isLog(coordinates[0]) }, y: { label: inWords(axes[1]), log: isLog(coordinates[1]) } };
  }

  words(layer, place) {
    const { axes, variable } = this.data;
    const [across, up] = this.along === MAP ? axes : [axes.find((axis) => axis.name === this.along) ?? axes[0], variable];
    const lines = [`${inWords(across)}: ${short(layer.xs[place])}`, `${inWords(up)}: ${short(layer.ys[place])}`];
    if (layer.values) lines.push(`${inWords(variable)}: ${short(layer.values[place])}`);
    return [...lines, `point ${layer.runs[place]}${layer.name ? `, ${layer.name}` : ""}`].join("\n");
  }

  zoomed(view) {
    const shown = this.along === MAP ? this.data.axes.slice(0, 2).map((axis) => axis.name) : [this.along];
    const room = this.along === MAP ? MAP_ROOM : 0; // what lies beside a map colours its edge
    const wider = ([low, high]) => [low - room * (high - low), high + room * (high - low)];
    this.within = view ? Object.fromEntries(shown.map((name, place) => [name, wider([view.x, view.y][place])])) : {};
    this.refresh();
  }

  fillTable() {
    if (!this.details.open || !this.data?.variable) return;
    const { axes, coordinates, value, run, direction, directions, outcome, outcomes, variable } = this.data;
    const names = ["Point", ...axes.map(inWords), "Direction", "Outcome", inWords(variable)];
    const rows = run.slice(0, TABLE_ROWS).map((number, place) =>
      [number, ...coordinates.map((column) => column[place]), directions[direction[place]], outcomes[outcome[place]], value[place]]);
    this.rows.replaceChildren(table(`The first ${rows.length} values`, names, rows));
  }
}

function middle(values) {
  return values[Math.floor(values.length / 2)];
}

/** Whether swept parameters move together or are drawn, so that none of them can be held. */
function movesTogether({ axes, coordinates }) {
  if (axes.length < 2) return false;
  const distinct = coordinates.map((column) => new Set(column).size), points = new Set(coordinates[0].map((_, place) => coordinates.map((column) => column[place]).join())).size;
  return points > 1 && distinct.every((count) => count === points);
}

/** Whether the first two coordinates are those of a grid, of which not all points have to be there yet. */
function isGrid({ coordinates: [across, up], total }) {
  return new Set(across).size * new Set(up).size <= total;
}

/** Whether values are spaced by equal ratios. */
function isLog(values) {
  const sorted = [...new Set(values)].filter((value) => value !== null).sort((a, b) => a - b);
  if (sorted.length < 4 || sorted[0] <= 0 || sorted.at(-1) < 20 * sorted[0]) return false;
  return sorted[Math.floor(sorted.length / 2)] < 0.7 * (sorted[0] + sorted.at(-1)) / 2;
}
