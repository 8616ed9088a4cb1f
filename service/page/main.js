// The page: the current view, the session, and the availability of the service.

import { ask, beginSession, endSession, Refusal, watch } from "./api.js";
import { showCampaign } from "./campaign.js";
import { showCampaigns } from "./campaigns.js";
import { showComparison } from "./compare.js";
import { button, element, tell } from "./dom.js";
import { showEstimate } from "./estimate.js";
import { showNew } from "./new_scene.js";
import { showRecordings } from "./recordings.js";

const main = document.getElementById("main");
const navigation = document.getElementById("navigation");
const banner = document.getElementById("banner");
const leave = document.getElementById("leave");
const VIEWS = {
  campaigns: ["Campaigns", showCampaigns], campaign: ["Campaign", showCampaign], new: ["New", showNew],
  compare: ["Compare", showComparison], recordings: ["Recordings", showRecordings],
  estimate: ["Estimate", showEstimate],
};
let close = () => {};
let known = false;

/** Show the view that the address names; a view returns the function that ends it. */
function route() {
  close();
  close = () => {};
  if (!known) return showSignIn();
  const [name, ...rest] = location.hash.replace(/^#\//, "").split("/").map(decoded);
  const [title, show] = VIEWS[name] ?? VIEWS.campaigns;
  document.title = `${title} · vibroimpact`;
  for (const link of navigation.querySelectorAll("a")) {
    const current = link.hash.slice(2) === (VIEWS[name] ? name : "campaigns");
    if (current) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  main.replaceChildren();
  close = show(main, ...rest) ?? close;
}

function decoded(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part; // an address typed by hand that no view knows
  }
}

function signedIn(whether) {
  known = whether;
  navigation.hidden = leave.hidden = !whether;
}

function showSignIn() {
  document.title = "Sign in · vibroimpact";
  const token = element("input", { type: "password", id: "token", autocomplete: "off", required: true, "aria-describedby": "token-help" });
  const said = element("p", { class: "problem", role: "alert" });
  const enter = element("button", { class: "main", type: "submit" }, "Sign in");
  const form = element("form", { onsubmit: submit },
    element("label", { for: "token" }, "Token of the service", token), enter, said);
  async function submit(event) {
    event.preventDefault();
    said.textContent = "";
    try {
      await beginSession(token.value.trim());
      token.value = "";
      await begin();
    } catch (error) {
      said.textContent = error.status === 401 ? "This is not the token of this service." : error.message;
      token.select();
    }
  }
  main.replaceChildren(element("section", { class: "card sign" },
    element("h1", {}, "Sign in"),
    element("p", { class: "muted", id: "token-help" },
      "The token is in the file ", element("code", {}, "token"), " of the folder that the service was started with. It is sent once and not kept in this page."),
    form));
  token.focus();
}

async function begin() {
  await ask("GET", "/campaigns?limit=1");
  signedIn(true);
  route();
}

watch(
  (lost) => {
    if (banner.hidden === !lost) return;
    banner.hidden = !lost;
    banner.textContent = lost ? "The service does not answer; trying again." : "";
    if (!lost) tell("The service answers again.");
  },
  () => { signedIn(false); route(); },
);
leave.addEventListener("click", async () => { await endSession(); signedIn(false); route(); });
window.addEventListener("hashchange", () => { route(); main.focus(); });
document.querySelector(".skip").addEventListener("click", (event) => { event.preventDefault(); main.focus(); });

begin().catch((error) => {
  if (error.status === 401) return;
  if (!(error instanceof Refusal)) throw error;
  main.replaceChildren(element("section", { class: "card sign" }, element("h1", {}, "No answer"),
    element("p", {}, error.message), button("Try again", () => location.reload(), { class: "main" })));
});
