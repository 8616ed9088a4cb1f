// Requests to the service. The session is a cookie that no script can read; the token is sent once and not kept.

const PREFIX = "/api/v1";

/** A refused request; `problems` are the problems of a scene, `status` is 0 without an answer. */
export class Refusal extends Error {
  constructor(message, status, problems = []) {
    super(message);
    this.status = status;
    this.problems = problems;
  }
}

const listeners = { lost: () => {}, unknown: () => {} };

/** Set the handlers for a service that stops or resumes answering, and for a session that has ended. */
export function watch(lost, unknown) {
  Object.assign(listeners, { lost, unknown });
}

export function address(path) {
  return PREFIX + path;
}

export function campaignPath(id, rest = "") {
  return `/campaigns/${encodeURIComponent(id)}${rest}`;
}

export function recordingPath(name, rest = "") {
  return `/recordings/${encodeURIComponent(name)}${rest}`;
}

/** Return a key that makes a submission count once. */
export function newKey() {
  const bytes = crypto.getRandomValues(new Uint8Array(16)); // randomUUID exists only over TLS
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function send(method, path, headers, body, signal) {
  let answer;
  try {
    answer = await fetch(PREFIX + path, { method, headers, body, signal, cache: "no-store" });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    listeners.lost(true);
    throw new Refusal("The service does not answer. Is it running?", 0);
  }
  listeners.lost(false);
  if (answer.ok) return answer;
  const told = await answer.json().catch(() => ({}));
  if (answer.status === 401 && path !== "/session") listeners.unknown();
  throw new Refusal(told.detail ?? `${answer.status} ${answer.statusText}`, answer.status, told.problems);
}

/** Return the JSON of an answer; null if it has none. */
export async function ask(method, path, { body, headers = {}, signal } = {}) {
  const raw = body instanceof Blob;
  const sent = body === undefined || raw ? body : JSON.stringify(body);
  const kind = sent === undefined ? {} : { "Content-Type": raw ? "application/octet-stream" : "application/json" };
  const answer = await send(method, path, { ...kind, ...headers }, sent, signal);
  return answer.status === 204 ? null : answer.json();
}

export async function askText(path) {
  return (await send("GET", path, {})).text();
}

export async function beginSession(token) {
  await send("POST", "/session", { Authorization: `Bearer ${token}` });
}

export async function endSession() {
  await send("DELETE", "/session", {});
}

/** Call a function at each event of a campaign, across lost connections; return a function that ends the calls. */
export function follow(id, happened) {
  const source = new EventSource(PREFIX + campaignPath(id, "/events"));
  // a stream begins with all past events: an event is a reason to ask for the state, not the state itself
  for (const kind of ["open", "state", "progress", "error"]) source.addEventListener(kind, happened);
  return () => source.close();
}
