// A new campaign: a scene is written, pasted or dropped, and checked during typing, with its problems at their lines.

import { ask, askText, campaignPath, newKey, recordingPath } from "./api.js";
import { button, element, field, namesIn, tell } from "./dom.js";

const PAUSE = 300; // milliseconds without typing after which a scene is checked
const LINE = 20; // height of a line, pixels; the same in style.css
const LARGEST = 2 ** 20;
const DRAFT = "vibroimpact-scene";
const REPLAY = /^\s*\[replay\]/m;

export function showNew(main, from = "", given = "") {
  const view = new NewScene();
  main.append(...view.nodes);
  view.begin(from, given);
  return () => view.close();
}

class NewScene {
  constructor() {
    this.text = element("textarea", {
      id: "scene", spellcheck: "false", autocapitalize: "off", autocomplete: "off", "aria-describedby": "scene-help",
      oninput: () => this.changed(), onscroll: () => { this.lines.scrollTop = this.text.scrollTop; },
    });
    this.lines = element("pre", { "aria-hidden": "true" });
    this.editor = element("div", {
      class: "editor", ondragover: (event) => { event.preventDefault(); this.editor.classList.add("over"); },
      ondragleave: () => this.editor.classList.remove("over"), ondrop: (event) => this.drop(event),
    }, this.lines, this.text);
    this.file = element("input", { type: "file", accept: ".toml,text/plain", id: "file", class: "unseen", onchange: () => this.read(this.file.files[0]) });
    this.workers = element("input", { type: "number", min: "1", max: "256", placeholder: "all", oninput: () => this.renewed() });
    this.fit = element("input", { type: "text", autocomplete: "off", oninput: () => this.renewed() });
    this.score = element("input", { type: "text", autocomplete: "off", oninput: () => this.renewed() });
    this.replaying = element("div", { class: "fields", hidden: true },
      field("Fit", this.fit, "Keys of numbers, with commas, for instance body.frequency."),
      field("Score", this.score, "Recordings that are not fitted, with commas."));
    this.submit = button("Submit", () => this.send(), { class: "main", disabled: true });
    this.said = element("p", { role: "status" });
    this.problems = element("ul", { class: "problems" });
    this.templates = element("ul", { class: "templates" });
    this.nodes = [
      element("div", { class: "head" }, element("h1", {}, "New campaign")),
      element("div", { class: "with-side" },
        element("section", { class: "card", "aria-label": "Scene" },
          element("div", { class: "row" }, element("label", { for: "scene" }, "Scene (TOML)"),
            element("span", { class: "muted small", id: "scene-help" }, "Write, paste or drop a file; it is checked as you type.")),
          this.editor, this.said, this.problems, this.replaying,
          element("div", { class: "row end" }, field("Workers", this.workers), this.submit,
            this.file, button("Open a file", () => this.file.click()))),
        element("section", { class: "card", "aria-labelledby": "templates-title" },
          element("h2", { id: "templates-title" }, "Start from an example"), this.templates))];
    this.file.tabIndex = -1;
    this.file.setAttribute("aria-label", "Scene file");
  }

  async begin(from, given) {
    const draft = sessionStorage.getItem(DRAFT);
    if (draft) this.write(draft);
    else this.number([]);
    try {
      await this.showExamples();
      if (from === "replay") this.write(replayOf(await ask("GET", recordingPath(given))));
      else if (from) await this.copy(from);
    } catch (error) {
      this.say(error.message, "problem");
    }
  }

  async showExamples() {
    const examples = await ask("GET", "/examples");
    this.templates.replaceChildren(...examples.map((one) => element("li", {},
      button(one.title || one.name, () => { this.write(one.scene); this.text.focus(); }))));
    examples.forEach((one, place) => this.templates.children[place].firstChild.append(element("small", {}, one.kind)));
  }

  /** Begin with the scene and options of another campaign. */
  async copy(from) {
    const { options, workers } = await ask("GET", campaignPath(from));
    this.write(await askText(campaignPath(from, "/scene")));
    this.fit.value = options.fit ?? "";
    this.score.value = (options.score ?? []).join(", ");
    this.workers.value = workers ?? "";
  }

  /** The next submission is another campaign. */
  renewed() {
    this.key = newKey();
  }

  close() {
    clearTimeout(this.timer);
    this.question?.abort();
  }

  write(text) {
    this.text.value = text;
    this.text.scrollTop = 0;
    this.changed();
  }

  changed() {
    sessionStorage.setItem(DRAFT, this.text.value);
    this.renewed();
    this.submit.disabled = true;
    this.replaying.hidden = !REPLAY.test(this.text.value);
    this.number([]);
    clearTimeout(this.timer);
    this.question?.abort();
    this.timer = setTimeout(() => this.check(), PAUSE);
  }

  async check() {
    if (!this.text.value.trim()) return this.show([], "");
    this.question = new AbortController();
    try {
      const { problems } = await ask("POST", "/scenes/validate", { body: { scene: this.text.value }, signal: this.question.signal });
      this.show(problems, problems.length ? `${problems.length} ${problems.length === 1 ? "problem" : "problems"}` : "The scene is sound.");
    } catch (error) {
      if (error.name !== "AbortError") this.say(error.message, "problem");
    }
  }

  show(problems, words) {
    this.submit.disabled = !words || problems.length > 0;
    this.say(words, problems.length ? "problem" : "good");
    this.number(problems);
    this.problems.replaceChildren(...problems.map((one) => element("li", {},
      button(`Line ${one.line}: ${one.message}`, () => this.jump(one)))));
  }

  say(words, kind) {
    this.said.className = kind;
    this.said.textContent = words;
  }

  /** Number the lines; highlight those with a problem. */
  number(problems) {
    const wrong = new Set(problems.map((one) => one.line));
    const count = this.text.value.split("\n").length;
    this.lines.replaceChildren(...Array.from({ length: count }, (_, place) =>
      element("span", { class: wrong.has(place + 1) ? "wrong" : null }, String(place + 1))));
    this.lines.scrollTop = this.text.scrollTop;
    this.text.setAttribute("aria-invalid", String(problems.length > 0));
  }

  jump({ line, column }) {
    const lines = this.text.value.split("\n");
    const start = lines.slice(0, line - 1).reduce((sum, one) => sum + one.length + 1, 0);
    const end = start + (lines[line - 1]?.length ?? 0);
    this.text.focus();
    this.text.setSelectionRange(Math.min(start + column - 1, end), end);
    this.text.scrollTop = Math.max(0, (line - 6) * LINE);
  }

  drop(event) {
    event.preventDefault();
    this.editor.classList.remove("over");
    const [file] = event.dataTransfer.files;
    if (file) this.read(file);
    else this.write(event.dataTransfer.getData("text"));
  }

  async read(file) {
    if (!file) return;
    if (file.size > LARGEST) return this.say(`${file.name}: expected a scene of at most 1 MiB, got ${file.size} byte.`, "problem");
    this.write(await file.text());
    tell(`${file.name} was read.`);
  }

  async send() {
    const body = { scene: this.text.value, workers: this.workers.value ? Number(this.workers.value) : null };
    if (!this.replaying.hidden) Object.assign(body, { fit: this.fit.value.trim() || null, score: namesIn(this.score.value) });
    this.submit.disabled = true;
    try {
      const job = await ask("POST", "/campaigns", { body, headers: { "Idempotency-Key": this.key } });
      sessionStorage.removeItem(DRAFT);
      location.hash = `#/campaign/${job.id}`;
    } catch (error) {
      if (error.problems.length && error.problems[0].line) this.show(error.problems, "The scene was refused.");
      else this.say(error.message, "problem");
      this.submit.disabled = false;
    }
  }
}

/** Return a scene for the replay of a recording: its first channel drives, its last one is compared. */
function replayOf({ name, channels }) {
  const sampled = channels.filter((one) => one.samples !== null).map((one) => one.name);
  const drive = sampled.length > 1 ? `drive = "base_acceleration"\nfrom = ${JSON.stringify(sampled[0])}\n` : "";
  return `[scene]
title = ${JSON.stringify(`Replay of ${name}`)}

[body]
kind = "beam"
boundary = "clamped-clamped"
length = 0.1            # m
mass_per_length = 0.3   # kg/m
frequency = 100.0       # Hz, of the first mode
modes = 1
damping_ratio = 0.015

[sensor]
location = 0.5

[replay]
recordings = [${JSON.stringify(name)}]
${drive}compare = [{ simulated = "beam.sensor.acceleration", measured = ${JSON.stringify(sampled.at(-1) ?? "")} }]
`;
}
