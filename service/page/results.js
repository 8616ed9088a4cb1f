// Results of a job: its figure, its log, its files.

import { address, ask, askText, campaignPath } from "./api.js";
import { choice, element, titleOf } from "./dom.js";

const TOLD = ["replay", "estimate"]; // kinds whose results are figure and log; other kinds have a diagram or a motion

export class Results {
  constructor(job) {
    Object.assign(this, { id: job.id, shown: null });
    this.log = element("pre", { class: "scroll tall log", role: "region", tabindex: "0", "aria-label": "Log" });
    this.said = element("details", { open: TOLD.includes(job.kind), ontoggle: () => this.readLog() }, element("summary", {}, "Log"), this.log);
    this.figure = element("div");
    this.files = element("div", { class: "row" });
    this.node = element("section", { class: "card", "aria-labelledby": "results-title" },
      element("h2", { id: "results-title" }, "Results"), this.files, this.figure, this.said);
  }

  /** Show the results of a job in its present state. */
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
    const place = element("div"), kinds = element("div");
    const draw = (kind) => place.replaceChildren(figure(campaignPath(this.id, `/figure?format=svg&kind=${kind}`), `Figure of ${titleOf(job)}`));
    const begin = async () => {
      if (place.children.length) return;
      draw("auto");
      const names = await figureKinds().catch(() => []); // the banner reports a missing answer
      if (names.length) kinds.replaceChildren(choice("Kind of figure", names.map((name) => [name, name.replaceAll("-", " ")]), "auto", draw));
    };
    return element("details", { open: TOLD.includes(job.kind), ontoggle: begin }, element("summary", {}, "Figure"), kinds, place);
  }

  async readLog() {
    if (!this.said.open || this.reading) return;
    this.reading = true;
    try {
      const text = await askText(campaignPath(this.id, "/log"));
      this.log.textContent = text.replace(/ +$/gm, "") || "Nothing yet.";
    } catch (error) {
      if (error.status !== 0) this.log.textContent = error.message; // otherwise the banner reports it
    } finally {
      this.reading = false;
    }
  }
}

/** Return the kinds of figures that the service draws. */
async function figureKinds() {
  const { paths } = await ask("GET", "/openapi.json");
  const { parameters } = paths[address("/campaigns/{name}/figure")].get;
  return parameters.find(({ name }) => name === "kind").schema.enum;
}

/** Return a picture that the service draws, or the reason why there is none. */
export function figure(path, text) {
  const made = element("img", { class: "figure", alt: text, src: address(path) });
  made.addEventListener("error", () => askText(path).catch((error) => made.replaceWith(element("p", { class: "problem" }, error.message))));
  return made;
}
