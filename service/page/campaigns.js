// All campaigns, the newest first: progress, speed, and remaining time.

import { ask } from "./api.js";
import { button, duration, element, kindOf, moment, short, stateBadge, titleOf } from "./dom.js";
import { Pace } from "./pace.js";

const EVERY = 1000; // milliseconds between two requests while a campaign runs
const SELDOM = 4000;
const ACTIVE = ["queued", "running", "cancelling"];

export function showCampaigns(main) {
  const body = element("tbody");
  const more = button("Older campaigns", () => { count += 50; look(); }, { hidden: true });
  const list = element("div", { class: "card" }, element("table", { class: "campaigns" },
    element("caption", { class: "unseen" }, "Campaigns, the newest first"),
    element("thead", {}, element("tr", {}, ["Campaign", "State", "Progress", "Points a second", "Time left", "Submitted"]
      .map((name) => element("th", { scope: "col" }, name)))),
    body), more);
  const nothing = element("div", { class: "card empty", hidden: true },
    element("p", {}, "No campaigns yet."),
    element("a", { class: "button main", href: "#/new" }, "Submit a scene"));
  main.append(element("div", { class: "head" }, element("h1", {}, "Campaigns"),
    element("a", { class: "button main", href: "#/new" }, "New campaign")), list, nothing);
  const paces = new Map();
  let timer, ended = false, count = 50;

  async function look() {
    clearTimeout(timer);
    let items = [];
    try {
      const page = await ask("GET", `/campaigns?limit=${Math.min(count, 200)}`);
      items = page.items;
      more.hidden = page.next === null || count >= 200;
      body.replaceChildren(...items.map((job) => row(job, paces)));
      list.hidden = !items.length;
      nothing.hidden = Boolean(items.length);
    } catch (error) {
      if (error.status !== 0) throw error; // the banner reports a missing answer
    } finally {
      const busy = items.some((job) => ACTIVE.includes(job.state));
      if (!ended) timer = setTimeout(look, busy ? EVERY : SELDOM);
    }
  }
  look();
  return () => { ended = true; clearTimeout(timer); };
}

function row(job, paces) {
  if (!paces.has(job.id)) paces.set(job.id, new Pace());
  const pace = paces.get(job.id);
  pace.note(job);
  const runs = job.state === "running";
  return element("tr", {},
    element("td", { class: "name" }, element("a", { href: `#/campaign/${job.id}` }, titleOf(job)),
      element("span", { class: "kind small muted" }, kindOf(job))),
    element("td", {}, stateBadge(job.state)),
    element("td", {}, job.total
      ? [element("progress", { max: job.total, value: job.done, "aria-label": `Points of ${titleOf(job)}` }),
         element("span", { class: "small muted" }, `${job.done} of ${job.total} ${job.kind === "campaign" ? "points" : kindOf(job)}`)]
      : element("span", { class: "small muted" }, job.message || "–")),
    numbered(runs && pace.rate ? short(Number(pace.rate.toPrecision(3))) : "–", "points a second"),
    numbered(runs ? duration(pace.left(job)) : "–", "left"),
    element("td", { class: "small muted" }, moment(job.created)));
}

/** Return a cell with a number, and with its unit for layouts without headings. */
function numbered(text, unit) {
  return element("td", { class: text === "–" ? "number nothing" : "number", "data-unit": unit }, text);
}
