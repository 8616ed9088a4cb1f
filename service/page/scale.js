// Conversion of numbers to places on the screen, and ticks between them.

/** Return an axis from `low` to `high` over the pixels `from` to `to`. */
export function scaleOf(low, high, from, to, logarithmic = false) {
  const way = logarithmic && low > 0 ? Math.log10 : (value) => value;
  const back = way === Math.log10 ? (value) => 10 ** value : (value) => value;
  const first = way(low), span = way(high) - first || 1;
  return {
    low, high, logarithmic: way === Math.log10,
    place: (value) => from + ((way(value) - first) / span) * (to - from),
    value: (place) => back(first + ((place - from) / (to - from)) * span),
    ticks: (count) => (way === Math.log10 && span >= 1 ? decades(low, high) : steps(low, high, count)),
  };
}

function steps(low, high, count) {
  const rough = (high - low) / Math.max(count, 1);
  if (!(rough > 0) || !Number.isFinite(rough)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((one) => one * power >= rough) * power;
  const found = [];
  for (let place = Math.ceil(low / step); place * step <= high * (1 + 1e-12) && found.length < 40; place++) {
    found.push(Number((place * step).toPrecision(12)));
  }
  return found;
}

function decades(low, high) {
  const found = [];
  for (let power = Math.ceil(Math.log10(low)); power <= Math.log10(high) + 1e-9; power++) found.push(10 ** power);
  return found.length > 8 ? found.filter((_, place) => place % Math.ceil(found.length / 8) === 0) : found;
}

/** Return the lowest and highest of numbers, with a margin. */
export function extent(lists, room = 0.04, logarithmic = false) {
  let low = Infinity, high = -Infinity;
  for (const list of lists) {
    for (const value of list) {
      if (value === null || !Number.isFinite(value) || (logarithmic && value <= 0)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return logarithmic ? [1, 10] : [0, 1];
  if (low === high) return logarithmic ? [low / 2, high * 2] : [low - (Math.abs(low) || 1) * 0.1, high + (Math.abs(high) || 1) * 0.1];
  if (logarithmic) return [low * (low / high) ** room, high * (high / low) ** room];
  return [low - (high - low) * room, high + (high - low) * room];
}

const STOPS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];

/** Return a colour (viridis) for a share between 0 and 1. */
export function colourOf(share) {
  const place = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const low = Math.min(Math.floor(place), STOPS.length - 2), rest = place - low;
  const [red, green, blue] = STOPS[low].map((one, channel) => Math.round(one + rest * (STOPS[low + 1][channel] - one)));
  return `rgb(${red},${green},${blue})`;
}

const CLASSES = ["#0F4C81", "#56A5DC", "#3C7D3C", "#9BC46B", "#7A4B9A", "#C79BD6", "#8A6D00", "#E0B53A"];
const OWN = { "no impacts": "#D9D9D9", chaos: "#B5410B", rest: "#8C8C8C", unknown: "#595959" };
const OTHER = "#000000"; // colour of further classes, beyond the distinguishable ones

/** Return a colour for each class of motion, as in the figures of `plot`: the first classes have their own colours. */
export function coloursOf(classes) {
  const orbits = classes.filter((name) => !OWN[name]).slice(0, CLASSES.length).sort();
  return classes.map((name) => OWN[name] ?? CLASSES[orbits.indexOf(name)] ?? OTHER);
}
