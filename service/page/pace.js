// Speed of a campaign, from its progress over the last seconds.

const MEMORY = 10; // duration over which the speed is measured, seconds

export class Pace {
  seen = [];

  /** Record the present progress of a campaign. */
  note({ done, state }) {
    const now = Date.now() / 1000;
    if (state !== "running" || done < (this.seen.at(-1)?.done ?? 0)) this.seen = [];
    if (state !== "running") return;
    this.seen.push({ at: now, done });
    while (this.seen.length > 2 && this.seen[1].at < now - MEMORY) this.seen.shift();
  }

  get rate() {
    const first = this.seen[0], last = this.seen.at(-1);
    return first && last.at > first.at ? (last.done - first.done) / (last.at - first.at) : 0;
  }

  /** Return the remaining seconds. */
  left({ done, total }) {
    return this.rate > 0 ? (total - done) / this.rate : NaN;
  }
}
