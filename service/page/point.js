// One point of a campaign, simulated again: its motion in time, its phase portrait, its impacts.

import { ask, campaignPath } from "./api.js";
import { button, element, inTitle, inWords, short, table, tell } from "./dom.js";
import { withGaps } from "./layers.js";
import { Plot } from "./plot.js";

const TABLE_ROWS = 200;
const AGAIN = 1200; // milliseconds until a busy service is asked again
const IMPACT = { impact_time: "Time", impact_phase: "Phase", impact_velocity: "Velocity", impact_impulse: "Impulse", impact_contact: "Stop", impact_restitution: "Restitution" };

/** Show a point below `host`; of two requests the later one wins. */
export async function showPoint(host, id, run, closed = null) {
  const mine = Symbol("question");
  host.asked = mine;
  host.hidden = false;
  const name = closed ? `Point ${run}` : "Motion";
  const head = element("div", { class: "head" }, element("h2", { tabindex: "-1" }, name), closed && button("Close", closed, { class: "last" }));
  const said = element("p", { class: "muted", role: "status" }, "Simulating …");
  host.replaceChildren(head, said);
  if (closed) { // before the simulation, so that later actions of the user are not interrupted
    head.querySelector("h2").focus({ preventScroll: true });
    host.scrollIntoView({ block: "nearest" });
  }
  tell(`${name}: simulating`);
  try {
    const data = await answered(id, run, () => host.asked === mine);
    if (host.asked !== mine) return;
    said.remove();
    host.append(...views(data));
    tell(`${name}: ${data.outcome}`);
  } catch (error) {
    if (host.asked === mine) said.replaceWith(element("p", { class: "problem", role: "alert" }, error.message));
  }
}

async function answered(id, run, wanted) {
  for (;;) {
    try {
      return await ask("GET", campaignPath(id, `/points/${run}`));
    } catch (error) {
      if (error.status !== 429 || !wanted()) throw error;
      await new Promise((resolve) => { setTimeout(resolve, AGAIN); });
    }
  }
}

function views(data) {
  const { samples, impacts } = data;
  const quantity = (name, label = name.replaceAll("_", " ")) => inWords({ label, units: data.units[name] });
  const facts = { ...data.coordinates, outcome: data.outcome, direction: data.direction };
  const made = [element("dl", { class: "facts" }, Object.entries(facts).map(([key, value]) =>
    element("div", {}, element("dt", {}, inTitle(key)), element("dd", {}, typeof value === "number" ? short(value) : value))))];
  for (const words of [data.message, ...data.left_out]) {
    if (words) made.push(element("p", { class: "small muted" }, words));
  }
  const grid = element("div", { class: "sides" });
  if (samples.time?.length) grid.append(seriesPlot(data, quantity), ...portraitPlot(data, quantity));
  else made.push(element("p", { class: "muted" }, "There is no motion in time of this point."));
  if (impacts.impact_time?.length) grid.append(impactPlot(impacts, quantity));
  if (grid.children.length === 3) grid.firstChild.classList.add("wide");
  made.push(grid);
  if (impacts.impact_time) made.push(impactTable(impacts, quantity));
  return made;
}

function panel(title, plot) {
  return element("section", { "aria-label": title }, element("h3", { class: "small" }, title), plot.node);
}

/** Return the stops of a displacement as a layer of horizontal or vertical lines. */
function stopsOf({ stops }, name, across) {
  return stops[name] ? [{ kind: "limits", colour: "limit", name: stops[name].length > 1 ? "stops" : "stop", at: stops[name], across, xs: [], ys: [] }] : [];
}

function seriesPlot(data, quantity) {
  const { samples } = data;
  const names = Object.keys(samples).filter((name) => name !== "time");
  let chosen = names[0];
  const plot = new Plot("Motion in time", { height: 280 });
  const draw = () => {
    const [xs, ys] = withGaps([samples.time, samples[chosen]], samples.time, data.impacts.impact_time);
    plot.show({
      layers: [{ kind: "line", readable: true, colour: "one", xs, ys }, ...stopsOf(data, chosen, true)],
      x: { label: quantity("time") }, y: { label: quantity(chosen) },
    });
  };
  const made = panel("Motion in time", plot);
  if (names.length > 1) {
    const select = element("select", { "aria-label": "Variable over time", onchange: () => { chosen = select.value; plot.view = null; draw(); } },
      names.map((name) => element("option", { value: name }, name)));
    made.querySelector("h3").append(" of ", select);
  }
  draw();
  return made;
}

function portraitPlot(data, quantity) {
  const { samples, periods } = data;
  const velocity = Object.keys(samples).find((name) => name === "velocity" || name.endsWith(".velocity"));
  const displacement = velocity?.replace(/velocity$/, "displacement");
  if (!velocity || !samples[displacement]) return [];
  const [xs, ys] = withGaps([samples[displacement], samples[velocity]], samples.time, data.impacts.impact_time);
  const layers = [{ kind: "line", readable: true, colour: "one", name: "orbit", xs, ys }, ...stopsOf(data, displacement, false)];
  if (periods.strobe_velocity) {
    layers.push({ kind: "points", size: 5, colour: "two", name: "once a period", xs: periods.strobe_displacement, ys: periods.strobe_velocity });
  }
  const plot = new Plot("Phase portrait", { height: 280 });
  plot.show({ layers, x: { label: quantity(displacement) }, y: { label: quantity(velocity) } });
  return [panel("Phase portrait", plot)];
}

function impactPlot(impacts, quantity) {
  const plot = new Plot("Impacts", { height: 280 });
  plot.show({
    layers: [{ kind: "stems", colour: "three", xs: impacts.impact_time, ys: impacts.impact_velocity }],
    x: { label: quantity("impact_time", "time") }, y: { label: quantity("impact_velocity", "velocity of approach") },
  });
  return panel("Impacts", plot);
}

function impactTable(impacts, quantity) {
  const count = impacts.impact_time.length;
  if (!count) return element("p", { class: "muted" }, "No impacts in what is shown.");
  const names = Object.keys(IMPACT).filter((name) => impacts[name]);
  const rows = impacts.impact_time.slice(0, TABLE_ROWS).map((_, place) => names.map((name) => impacts[name][place]));
  const which = count > TABLE_ROWS ? `The first ${TABLE_ROWS} of ${count} impacts` : `${count} impacts`;
  return element("details", {}, element("summary", {}, `${which}, as a table`),
    element("div", { class: "scroll tall", tabindex: "0", role: "region", "aria-label": "Impacts as a table" },
      table("Impacts", names.map((name) => quantity(name, IMPACT[name])), rows)));
}
