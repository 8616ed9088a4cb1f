// One campaign: its progress, its diagram, a point of it, its failures, and its actions.

import { ask, campaignPath, follow } from "./api.js";
import { Diagram } from "./diagram.js";
import { button, duration, element, inTitle, kindOf, moment, namesIn, short, stateBadge, table, tell, titleOf } from "./dom.js";
import { Pace } from "./pace.js";
import { showPoint } from "./point.js";
import { Results } from "./results.js";

const ENDED = ["done", "failed", "cancelled"];
const PAUSE = 250; // milliseconds between two requests for the progress
const TENTHS = 10; // number of reports of progress to screen readers

export function showCampaign(main, id) {
  const view = new CampaignView(main, id);
  view.begin();
  return () => view.close();
}

class CampaignView {
  constructor(main, id) {
    Object.assign(this, { main, id, pace: new Pace(), stop: () => {}, ended: false, toldTenth: 0 });
    this.progress = element("progress", { max: 1, value: 0, "aria-label": "Points that are done" });
    this.state = element("span");
    this.acts = element("div", { class: "row" });
    this.facts = element("dl", { class: "facts" });
    this.message = element("p", { class: "small muted" });
    this.said = element("p", { class: "problem", role: "alert" });
    this.point = element("section", { class: "card", "aria-label": "The chosen point", hidden: true });
    this.failures = element("section", { class: "card", hidden: true, "aria-labelledby": "failures-title" });
  }

  async begin() {
    try {
      this.job = await ask("GET", campaignPath(this.id));
    } catch (error) {
      this.main.append(element("div", { class: "card empty" }, element("h1", {}, "No such campaign"), element("p", {}, error.message),
        element("a", { class: "button", href: "#/campaigns" }, "All campaigns")));
      return;
    }
    if (this.ended) return;
    const title = titleOf(this.job);
    document.title = `${title} · vibroimpact`;
    this.results = new Results(this.job);
    this.main.append(
      element("div", { class: "head" }, element("h1", {}, title), this.state, this.acts),
      element("section", { class: "card", "aria-label": "Progress" }, this.progress, this.facts, this.message, this.said));
    if (this.job.kind === "campaign") {
      this.diagram = new Diagram(this.id, "Diagram", (run) => showPoint(this.point, this.id, run, () => { this.point.hidden = true; }));
      this.main.append(element("section", { class: "card", "aria-label": "Diagram" }, element("h2", {}, "Diagram"),
        element("p", { class: "small muted" }, "Choose a point to see its motion. Drag to zoom."), this.diagram.node));
      this.diagram.refresh();
    }
    this.main.append(this.point, this.failures, this.results.node);
    this.seen(this.job);
    this.watchEvents();
  }

  watchEvents() {
    this.stop();
    this.stop = ENDED.includes(this.job.state) ? () => {} : follow(this.id, () => this.look());
  }

  /** Request the progress, once for all events within a pause. */
  look() {
    this.timer ??= setTimeout(async () => {
      const job = await this.ask("GET");
      this.timer = null;
      if (job && !this.ended) this.seen(job);
    }, PAUSE);
  }

  close() {
    this.ended = true;
    this.stop();
    clearTimeout(this.timer);
    this.diagram?.close();
  }

  seen(job) {
    const before = this.shown;
    Object.assign(this, { job, shown: job.state });
    this.pace.note(job);
    this.progress.max = job.total || 1;
    this.progress.value = job.done;
    this.state.replaceChildren(stateBadge(job.state));
    this.message.textContent = job.message || (job.state === "running" && !job.total ? "Its workers are starting." : "");
    this.message.className = job.state === "failed" ? "problem" : "small muted";
    this.showFacts();
    this.results.show(job);
    this.diagram?.refresh();
    if (before === job.state) return this.tellTenth();
    if (before) tell(`The ${kindOf(job)} is ${job.state}.`);
    this.showActs();
    if (ENDED.includes(job.state)) this.finish();
  }

  tellTenth() {
    const tenth = this.job.total ? Math.floor((TENTHS * this.job.done) / this.job.total) : 0;
    if (tenth > this.toldTenth) {
      tell(`${tenth * TENTHS} per cent of the points are done.`);
      this.lookForFailures();
    }
    this.toldTenth = tenth;
  }

  showFacts() {
    const { job, pace } = this, runs = job.state === "running";
    const facts = job.kind === "campaign" ? { Points: job.total ? `${job.done} of ${job.total}` : "–" } : { Kind: kindOf(job) };
    Object.assign(facts, askedFor(job.options));
    if (runs && job.kind === "campaign") {
      facts["Points a second"] = pace.rate ? short(Number(pace.rate.toPrecision(3))) : "–";
      facts["Time left"] = duration(pace.left(job));
    }
    if (job.ended && job.started) facts.Took = duration(job.ended - job.started);
    facts.Submitted = moment(job.created);
    if (job.kind === "campaign") facts.Workers = job.workers ?? "all processors";
    facts.Id = this.id.slice(0, 8);
    this.facts.replaceChildren(...Object.entries(facts).map(([key, value]) =>
      element("div", {}, element("dt", {}, key), element("dd", {}, String(value)))));
  }

  showActs() {
    const { state } = this.job, made = [];
    if (["queued", "running"].includes(state)) made.push(button("Cancel", () => this.act("POST", "/cancel"), { class: "danger" }));
    if (["cancelled", "failed"].includes(state)) made.push(button("Resume", () => this.act("POST", "/resume"), { class: "main" }));
    if (ENDED.includes(state)) made.push(button("Delete", () => this.remove(), { class: "danger" }));
    if (this.job.kind !== "estimate") made.push(element("a", { class: "button", href: `#/new/${this.id}` }, "Edit a copy"));
    if (this.job.kind === "run" && state === "done") made.push(element("a", { class: "button", href: `#/estimate/campaign/${this.id}` }, "Estimate"));
    if (this.job.kind === "campaign") made.push(element("a", { class: "button", href: `#/compare/${this.id}` }, "Compare"));
    const had = this.acts.contains(document.activeElement);
    this.acts.replaceChildren(...made);
    if (had) this.acts.firstChild.focus();
  }

  async ask(method, rest = "") {
    try {
      this.said.textContent = "";
      return await ask(method, campaignPath(this.id, rest));
    } catch (error) {
      if (error.status !== 0) this.said.textContent = error.message; // otherwise the banner reports it
      return null;
    }
  }

  async act(method, rest) {
    const job = await this.ask(method, rest);
    if (!job || this.ended) return;
    this.seen(job);
    this.watchEvents();
  }

  async remove() {
    if (!confirm(`Delete this ${kindOf(this.job)} with all of its results?`)) return;
    try {
      await ask("DELETE", campaignPath(this.id));
      location.hash = "#/campaigns";
    } catch (error) {
      this.said.textContent = error.message;
    }
  }

  /** Show the results once a campaign has ended. */
  async finish() {
    this.stop();
    if (this.job.kind === "run" && this.job.state === "done") showPoint(this.point, this.id, 0);
    await this.lookForFailures();
  }

  async lookForFailures() {
    if (this.job.kind !== "campaign" && this.job.kind !== "run") return;
    const found = await this.ask("GET", "/failures?limit=200");
    if (found?.total && found.total !== this.failed && !this.ended) this.showFailures(found);
  }

  showFailures({ total, items }) {
    this.failed = total;
    const names = Object.keys(items[0].coordinates);
    const rows = items.map((one) => [
      this.diagram ? button(`Point ${one.run}`, () => showPoint(this.point, this.id, one.run, () => { this.point.hidden = true; })) : String(one.run),
      one.message, one.outcome, ...names.map((name) => one.coordinates[name]),
    ]);
    this.failures.hidden = false;
    this.failures.replaceChildren(element("h2", { id: "failures-title" }, `${total} ${total === 1 ? "point" : "points"} did not come to ${total === 1 ? "its" : "their"} end`),
      element("div", { class: "scroll tall", tabindex: "0", role: "region", "aria-label": "Points that failed" },
        table("Points that failed, and why", ["Point", "Why", "Outcome", ...names.map((name) => name.replaceAll("_", " "))], rows)));
  }
}

/** Return the options of a job besides its scene, as facts. */
function askedFor({ fit, score, data, asked }) {
  const facts = {};
  if (fit) facts.Fitted = namesIn(fit).join(", ");
  if (score?.length) facts.Scored = score.join(", ");
  if (data) facts.Of = data;
  for (const [key, value] of Object.entries(asked ?? {})) {
    if (value !== null && value !== false && key !== "kind") facts[inTitle(key)] = String(value);
  }
  return facts;
}
