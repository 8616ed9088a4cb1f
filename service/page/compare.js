// Two campaigns side by side.

import { ask } from "./api.js";
import { Diagram } from "./diagram.js";
import { choice, element, stateBadge, titleOf } from "./dom.js";
import { showPoint } from "./point.js";

const EVERY = 1500;

export function showComparison(main, first = "", second = "") {
  main.append(element("div", { class: "head" }, element("h1", {}, "Two campaigns side by side")));
  const open = [];
  let ended = false, timer;
  ask("GET", "/campaigns?limit=200").then(({ items }) => {
    if (ended) return;
    const swept = items.filter((job) => job.kind === "campaign");
    if (!swept.length) {
      main.append(element("div", { class: "card empty" }, "There are no campaigns to compare yet."));
      return;
    }
    const ids = swept.map((job) => job.id);
    const chosen = [ids.includes(first) ? first : ids[0]];
    chosen.push(ids.includes(second) ? second : ids.find((id) => id !== chosen[0]) ?? chosen[0]);
    const sides = element("div", { class: "sides" });
    const same = element("input", { type: "checkbox", id: "same-axes", onchange: () => share(open, same.checked) });
    main.append(element("p", {}, element("label", { class: "check", for: same.id }, same, "Same axes, zoomed together")), sides);
    chosen.forEach((id, place) => {
      const job = swept.find((one) => one.id === id), name = place ? "Right" : "Left";
      const point = element("div", { hidden: true });
      const diagram = new Diagram(id, `${name} diagram`, (run) => showPoint(point, id, run, () => { point.hidden = true; }), 320);
      const options = swept.map((one) => [one.id, one.title ? `${one.title} (${one.id.slice(0, 8)})` : titleOf(one)]);
      sides.append(element("section", { class: "card", "aria-label": name },
        element("div", { class: "row end" }, choice(name, options, id, (other) => go(chosen, place, other)), stateBadge(job.state)),
        element("h2", {}, element("a", { href: `#/campaign/${id}` }, titleOf(job))),
        diagram.node, point));
      open.push(diagram);
      diagram.refresh();
    });
    timer = setInterval(() => open.filter((one) => one.data?.state !== "done").forEach((one) => one.refresh()), EVERY);
  }, (error) => main.append(element("p", { class: "problem", role: "alert" }, error.message)));
  return () => { ended = true; clearInterval(timer); open.forEach((one) => one.close()); };
}

function share(diagrams, whether) {
  for (const { plot } of diagrams) plot.share(whether ? diagrams.map((one) => one.plot).filter((other) => other !== plot) : []);
}

function go(chosen, place, other) {
  const next = chosen.slice();
  next[place] = other;
  location.hash = `#/compare/${next.join("/")}`;
}
