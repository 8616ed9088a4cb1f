// The recordings of a service: uploaded, viewed, replayed, used for estimates, deleted.

import { address, ask, recordingPath } from "./api.js";
import { button, element, field, inWords, moment, namesIn, tell } from "./dom.js";
import { figure } from "./results.js";

export function showRecordings(main) {
  const list = element("ul", { class: "recordings" });
  const nothing = element("p", { class: "empty", hidden: true }, "No recordings yet.");
  const more = button("Older recordings", () => look(more.dataset.next), { hidden: true });
  const said = element("p", { class: "problem", role: "alert" });

  async function look(cursor = "") {
    try {
      const page = await ask("GET", `/recordings${cursor ? `?cursor=${encodeURIComponent(cursor)}` : ""}`);
      if (!cursor) list.replaceChildren();
      list.append(...page.items.map((one) => entry(one, remove)));
      more.hidden = page.next === null;
      more.dataset.next = page.next ?? "";
      nothing.hidden = Boolean(list.children.length);
      said.textContent = "";
    } catch (error) {
      said.textContent = error.message;
    }
  }

  async function remove(one) {
    if (!confirm(`Delete the recording ${one.name}? Campaigns that were submitted with it keep what they read.`)) return;
    try {
      await ask("DELETE", recordingPath(one.id));
      tell(`${one.name} was deleted.`);
      await look();
    } catch (error) {
      said.textContent = error.message;
    }
  }

  main.append(element("div", { class: "head" }, element("h1", {}, "Recordings")),
    sender(look), element("section", { class: "card", "aria-label": "Recordings" }, said, list, nothing, more));
  look();
}

/** Return the part of the page where files are chosen or dropped. */
function sender(received) {
  const names = element("input", { type: "text", autocomplete: "off" });
  const units = element("input", { type: "text", autocomplete: "off" });
  const rate = element("input", { type: "text", inputmode: "decimal", autocomplete: "off" });
  const list = element("ul", { class: "received", "aria-live": "polite" });
  const files = element("input", { type: "file", id: "recording", class: "unseen", multiple: true, tabindex: "-1", "aria-label": "Files of measurements", onchange: () => send([...files.files]) });
  const place = element("div", {
    class: "dropped", ondragover: (event) => { event.preventDefault(); place.classList.add("over"); },
    ondragleave: () => place.classList.remove("over"), ondrop: drop,
  }, element("span", {}, "Drop files of measurements here, or"), button("Choose files", () => files.click(), { class: "main" }), files);

  function drop(event) {
    event.preventDefault();
    place.classList.remove("over");
    send([...event.dataTransfer.files]);
  }

  function settings() {
    const found = {};
    if (names.value.trim()) found.name = namesIn(names.value);
    if (units.value.trim()) found.unit = namesIn(units.value);
    if (rate.value.trim()) found.rate = Number(rate.value);
    return JSON.stringify(found);
  }

  async function send(chosen) {
    files.value = "";
    list.replaceChildren();
    for (const file of chosen) {
      const line = element("li", { class: "muted" }, `Sending ${file.name} …`);
      list.append(line);
      try {
        const found = await ask("POST", `/recordings?${new URLSearchParams({ name: file.name, settings: settings() })}`, { body: file });
        line.className = "good";
        line.textContent = `${file.name} was received as ${found.name}.`;
        await received();
      } catch (error) {
        line.className = "problem";
        line.textContent = `${file.name}: ${error.message.replace(`${file.name}: `, "")}`;
      }
    }
  }

  return element("section", { class: "card", "aria-label": "Send recordings" }, place,
    element("details", {}, element("summary", {}, "What files of text do not say"),
      element("div", { class: "fields" },
        field("Names of the channels", names, "With commas, for instance base, board."),
        field("Units", units, "With commas, for instance g, m/s^2."),
        field("Samples a second", rate, "Where no column is the time."))),
    list);
}

function entry(one, remove) {
  const drawn = element("details", { ontoggle: () => { if (drawn.open && !drawn.querySelector("img")) drawn.append(figure(recordingPath(one.id, "/figure?format=svg"), `Channels of ${one.name}`)); } },
    element("summary", { "aria-label": `Figure of ${one.name}` }, "Figure"));
  const link = (href, text) => element("a", { class: "button", href, "aria-label": `${text} ${one.name}` }, text);
  return element("li", {},
    element("h2", {}, one.name),
    element("p", { class: "small" }, one.channels.map(contents).join(", "), element("span", { class: "muted" }, ` · ${size(one.bytes)} · ${moment(one.created)}`)),
    element("div", { class: "row" },
      link(`#/new/replay/${one.id}`, "Replay"), link(`#/estimate/recording/${one.id}`, "Estimate"),
      element("a", { class: "button", href: address(recordingPath(one.id, "/file")), download: one.name, "aria-label": `Download ${one.name}` }, "Download"),
      button("Delete", () => remove(one), { class: "danger", "aria-label": `Delete ${one.name}` })),
    drawn);
}

function contents({ name, units, samples, events }) {
  return `${inWords({ label: name, units })}: ${samples === null ? `${events} events` : `${samples} samples`}`;
}

function size(bytes) {
  const [unit, divisor] = bytes < 1e4 ? ["B", 1] : bytes < 1e7 ? ["kB", 1e3] : ["MB", 1e6];
  return `${Math.round(bytes / divisor)} ${unit}`;
}
