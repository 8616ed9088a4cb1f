// What a job leaves: its figure, what it said, its files.

import { address, askText, campaignPath } from "./api.js";
import { element, titleOf } from "./dom.js";

const TOLD = ["replay", "estimate"]; // their results are their figure and what they say; others have a diagram or a motion

export class Results {
  constructor(job) {
    Object.assign(this, { id: job.id, shown: null });
    this.log = element("pre", { class: "scroll tall log", tabindex: "0", "aria-label": "Log" });
    this.said = element("details", { open: TOLD.includes(job.kind), ontoggle: () => this.readLog() }, element("summary", {}, "Log"), this.log);
    this.figure = element("div");
    this.files = element("div", { class: "row" });
    this.node = element("section", { class: "card", "aria-labelledby": "results-title" },
      element("h2", { id: "results-title" }, "Results"), this.files, this.figure, this.said);
  }

  /** Show what there is of a job as it is now. */
  show(job) {
    this.readLog();
    if (this.shown === job.state) return;
    this.shown = job.state;
    const done = job.state === "done", made = [];
    if (done) made.push(this.link("/dataset", "Dataset (NetCDF)", "nc"));
    if (job.kind !== "estimate") made.push(this.link("/scene", "Scene (TOML)", "toml"));
    if (done && job.options.fit) made.push(this.link("/scene?fitted=true", "Fitted scene (TOML)", "fitted.toml"));
    if (done) made.push(this.link("/figure?format=svg", "Figure (SVG)", "svg"), this.link("/figure?format=png", "Figure (PNG)", "png"));
    this.files.replaceChildren(...made, this.link("/log", "Log", "log"));
    this.figure.replaceChildren(...(done ? [this.drawn(job)] : []));
  }

  link(rest, text, ending) {
    return element("a", { class: "button", href: address(campaignPath(this.id, rest)), download: `${this.id}.${ending}` }, text);
  }

  drawn(job) {
    const made = figure(campaignPath(this.id, "/figure?format=svg"), `Figure of ${titleOf(job)}`);
    return TOLD.includes(job.kind) ? made : element("details", {}, element("summary", {}, "Figure"), made);
  }

  async readLog() {
    if (!this.said.open || this.reading) return;
    this.reading = true;
    try {
      const text = await askText(campaignPath(this.id, "/log"));
      this.log.textContent = text.replace(/ +$/gm, "") || "Nothing yet.";
    } catch (error) {
      if (error.status !== 0) this.log.textContent = error.message; // else the banner says it
    } finally {
      this.reading = false;
    }
  }
}

/** Return a picture that the service draws, asked for once it is seen. */
export function figure(path, text) {
  const made = element("img", { class: "figure", loading: "lazy", alt: text, src: address(path) });
  made.addEventListener("error", () => made.replaceWith(element("p", { class: "small muted" }, "There is no figure of this.")));
  return made;
}
