// The recordings that a service has: sent to it, listed with their channels, replayed.

import { ask } from "./api.js";
import { button, element, moment, tell } from "./dom.js";

export function showRecordings(main) {
  const file = element("input", { type: "file", id: "recording", required: true });
  const said = element("p", { role: "status" });
  const body = element("tbody");
  const listing = element("div", { class: "scroll" }, element("table", {},
    element("caption", { class: "unseen" }, "Recordings of this service"),
    element("thead", {}, element("tr", {}, ["Recording", "Channels", "Size", "Sent", ""].map((name) =>
      name ? element("th", { scope: "col" }, name) : element("td", {})))), body));
  const nothing = element("p", { class: "empty", hidden: true }, "No recordings yet.");
  const more = button("More", () => look(more.dataset.next), { hidden: true });
  const cards = element("section", { class: "card", "aria-label": "Recordings" }, listing, nothing, more);
  const enter = element("button", { class: "main", type: "submit" }, "Send");
  const form = element("form", { class: "row end", onsubmit: send }, element("label", { for: "recording" }, "A file of a measurement", file), enter);

  async function send(event) {
    event.preventDefault();
    const [chosen] = file.files;
    enter.disabled = true;
    said.className = "muted";
    said.textContent = `Sending ${chosen.name} …`;
    try {
      await ask("POST", `/recordings?name=${encodeURIComponent(chosen.name)}`, { body: chosen });
      said.className = "good";
      said.textContent = `${chosen.name} was received.`;
      form.reset();
      look();
    } catch (error) {
      said.className = "problem";
      said.textContent = error.message;
    } finally {
      enter.disabled = false;
    }
  }

  async function look(cursor = "") {
    try {
      const page = await ask("GET", `/recordings${cursor ? `?cursor=${encodeURIComponent(cursor)}` : ""}`);
      if (!cursor) body.replaceChildren();
      body.append(...page.items.map(row));
      more.hidden = !page.next;
      more.dataset.next = page.next ?? "";
      listing.hidden = !body.children.length;
      nothing.hidden = Boolean(body.children.length);
      tell(`${body.children.length} recordings`);
    } catch (error) {
      said.className = "problem";
      said.textContent = error.status === 404 ? "This service takes no recordings." : error.message;
      form.hidden = cards.hidden = error.status === 404;
    }
  }

  main.append(element("div", { class: "head" }, element("h1", {}, "Recordings")),
    element("section", { class: "card", "aria-label": "Send a recording" }, form, said),
    cards);
  look();
}

function row(one) {
  const channels = one.channels.map(({ name, units }) => (units && units !== "1" ? `${name} (${units})` : name)).join(", ");
  return element("tr", {}, element("td", { class: "name" }, one.name), element("td", { class: "small" }, channels),
    element("td", { class: "number" }, size(one.bytes)), element("td", { class: "small muted" }, when(one.created)),
    element("td", {}, element("a", { class: "button", href: `#/new/replay/${encodeURIComponent(one.name)}`, "aria-label": `Replay ${one.name}` }, "Replay")));
}

function size(bytes) {
  const [unit, divisor] = bytes < 1e4 ? ["B", 1] : bytes < 1e7 ? ["kB", 1e3] : ["MB", 1e6];
  return `${Math.round(bytes / divisor)} ${unit}`;
}

function when(created) {
  return typeof created === "number" ? moment(created) : new Date(created).toLocaleString();
}
