// Elements, numbers and words for all views.

/** Return an element with attributes, on* listeners, and children; text is never parsed as markup. */
export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return made;
}

export function button(text, action, attributes = {}) {
  return element("button", { type: "button", onclick: action, ...attributes }, text);
}

/** Return a table; cells with numbers are formatted as numbers. */
export function table(caption, names, rows) {
  const cell = (one) => typeof one === "number"
    ? element("td", { class: "number" }, short(one))
    : element("td", {}, one ?? "–");
  return element("table", {},
    element("caption", { class: "unseen" }, caption),
    element("thead", {}, element("tr", {}, names.map((name) => element("th", { scope: "col" }, name)))),
    element("tbody", {}, rows.map((row) => element("tr", {}, row.map(cell)))));
}

let fields = 0;

/** Return a control below its label. */
export function field(label, control, help = null) {
  control.id ||= `field-${++fields}`;
  if (help) control.setAttribute("aria-describedby", `${control.id}-help`);
  return element("div", { class: "field" }, element("label", { for: control.id }, label), control,
    help && element("small", { class: "muted", id: `${control.id}-help` }, help));
}

/** Return a list of choices from pairs of a value and its text. */
export function choice(label, options, chosen, changed, help = null) {
  const select = element("select", { onchange: () => changed(select.value) },
    options.map(([value, text]) => element("option", { value, selected: value === chosen }, text)));
  return field(label, select, help);
}

/** Return a number with five digits. */
export function short(number) {
  if (number === null || number === undefined || Number.isNaN(number)) return "–";
  if (Number.isInteger(number) && Math.abs(number) < 1e7) return String(number);
  return String(Number(number.toPrecision(5)));
}

export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  if (seconds < 1) return "less than 1 s";
  if (seconds < 100) return `${Math.round(seconds)} s`;
  if (seconds < 6000) return `${Math.round(seconds / 60)} min`;
  return seconds < 172800 ? `${Math.round(seconds / 3600)} h` : `${Math.round(seconds / 86400)} days`;
}

export function moment(seconds) {
  return seconds ? new Date(seconds * 1000).toLocaleString([], { dateStyle: "medium", timeStyle: "short" }) : "–";
}

/** Return the label of a quantity with its unit. */
export function inWords({ label, units }) {
  return units && units !== "1" ? `${label} (${unitInWords(units)})` : label;
}

/** Return a unit for display: `m s-2` becomes m/s². */
function unitInWords(units) {
  const parts = units.split(" ").map((part) => /^(\D+?)(-?\d*)$/.exec(part) ?? [part, part, ""]);
  const written = ([, name, power]) => name + ({ 2: "²", 3: "³", 4: "⁴" }[power.replace("-", "")] ?? "");
  const [above, below] = [parts.filter((one) => !one[2].startsWith("-")), parts.filter((one) => one[2].startsWith("-"))];
  return [above.map(written).join(" ") || "1", ...below.map(written)].join("/");
}

/** Return the kind of a job in a word. */
export function kindOf({ kind, options }) {
  return options.fit ? "fit" : kind;
}

export function titleOf(job) {
  return job.title || `Untitled ${kindOf(job)} ${job.id.slice(0, 8)}`;
}

/** Return a name of the API as a heading: `stop_position` is Stop position. */
export function inTitle(name) {
  return name[0].toUpperCase() + name.slice(1).replaceAll("_", " ");
}

/** Return the names in a text, with commas between them. */
export function namesIn(text) {
  return text.split(",").map((name) => name.trim()).filter(Boolean);
}

export function stateBadge(state) {
  return element("span", { class: `state ${state}` }, state);
}

/** Report a change to screen readers. */
export function tell(text) {
  const news = document.getElementById("news");
  if (news.textContent !== text) news.textContent = text;
}
