// An estimate from a recording or a run: its form is made from the service's description of its API.

import { ask, campaignPath, newKey, recordingPath } from "./api.js";
import { choice, element, field, inTitle, titleOf } from "./dom.js";

const CHANNELS = ["channel", "drive"]; // options whose value is a channel of a recording

export function showEstimate(main, source = "", id = "") {
  const view = new EstimateView(source, id);
  main.append(...view.nodes);
  view.begin();
}

class EstimateView {
  constructor(source, id) {
    Object.assign(this, { source, id, key: newKey(), kind: "decay" });
    this.title = element("h1", {}, "Estimate");
    this.fields = element("div");
    this.said = element("p", { class: "problem", role: "alert" });
    this.form = element("form", { hidden: true, oninput: () => { this.key = newKey(); }, onsubmit: (event) => this.send(event) },
      this.fields, element("button", { class: "main", type: "submit" }, "Estimate"));
    this.nodes = [element("div", { class: "head" }, this.title), element("section", { class: "card", "aria-label": "What to estimate" }, this.form, this.said)];
  }

  async begin() {
    try {
      const data = await ask("GET", this.source === "recording" ? recordingPath(this.id) : campaignPath(this.id));
      this.title.textContent = `Estimate from ${data.name ?? titleOf(data)}`;
      this.channels = data.channels ?? [];
      const { components } = await ask("GET", "/openapi.json");
      const { mapping } = components.schemas.EstimateRequest.properties.estimate.discriminator;
      this.kinds = Object.fromEntries(Object.entries(mapping).map(([kind, place]) => [kind, components.schemas[place.split("/").at(-1)]]));
      this.form.hidden = false;
      this.show();
    } catch (error) {
      this.said.textContent = error.message;
    }
  }

  show() {
    const { description, properties } = this.kinds[this.kind];
    this.controls = {};
    const made = Object.entries(properties).filter(([key]) => key !== "kind").map(([key, schema]) => this.control(key, schema));
    const kinds = choice("Estimate", Object.keys(this.kinds).map((kind) => [kind, kind]), this.kind, (kind) => { this.kind = kind; this.show(); kindSelect().focus(); }, description);
    const kindSelect = () => this.fields.querySelector("select");
    this.fields.replaceChildren(element("div", { class: "fields" }, kinds), element("div", { class: "fields" }, made));
  }

  /** Return the field of an option, from its JSON schema; `controls` gets the function that reads its value. */
  control(key, schema) {
    const label = inTitle(key), help = schema.description, kind = schema.anyOf?.[0] ?? schema;
    const names = key === "events" ? this.named("events") : CHANNELS.includes(key) ? this.named("samples") : [];
    if (names.length || kind.enum) {
      const options = kind.enum ? kind.enum.map((one) => [one, one]) : [["", "–"], ...names.map((one) => [one, one])];
      const made = choice(label, options, schema.default ?? (key === "channel" ? names.at(-1) : ""), () => {}, help);
      const select = made.querySelector("select");
      this.controls[key] = () => select.value || null;
      return made;
    }
    if (kind.type === "boolean") {
      const box = element("input", { type: "checkbox", id: `estimate-${key}`, checked: schema.default });
      this.controls[key] = () => box.checked;
      return element("div", { class: "field" }, element("label", { class: "check", for: box.id }, box, help ?? label));
    }
    const input = element("input", { type: "text", autocomplete: "off", value: schema.default, inputmode: kind.type === "string" ? null : "decimal" });
    this.controls[key] = () => valueOf(input.value.trim(), kind.type);
    return field(label, input, help);
  }

  named(count) {
    return this.channels.filter((one) => one[count] !== null).map(({ name }) => name);
  }

  async send(event) {
    event.preventDefault();
    this.said.textContent = "";
    const given = Object.entries(this.controls).map(([key, read]) => [key, read()]).filter(([, value]) => value !== null);
    try {
      const body = { [this.source]: this.id, estimate: { kind: this.kind, ...Object.fromEntries(given) } };
      const job = await ask("POST", "/estimates", { body, headers: { "Idempotency-Key": this.key } });
      location.hash = `#/campaign/${job.id}`;
    } catch (error) {
      this.said.textContent = error.message;
    }
  }
}

/** Return the input as a text, a number, or a list separated by commas; other input is sent unchanged. */
function valueOf(text, type) {
  if (!text) return null;
  if (type === "array") return text.split(",").map((one) => valueOf(one.trim(), "number"));
  return type === "string" || Number.isNaN(Number(text)) ? text : Number(text);
}
