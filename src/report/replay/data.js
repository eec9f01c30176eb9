// The episode, and what every part of the page asks about it.

const episode = JSON.parse(document.getElementById("episode").textContent);
const lastStep = episode.vessels[0].north_m.length - 1;
const duration = Math.max(lastStep, 0) * episode.dt_s;
const own = episode.vessels[0];
const targets = episode.targets;

const element = (id) => document.getElementById(id);
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const radians = (degrees) => (degrees * Math.PI) / 180;

/** A new element with text and attributes; text is never read as markup. */
function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

/** The step at or before a time, and how far the next one is reached. */
function locate(time) {
  const steps = clamp(time / episode.dt_s, 0, lastStep);
  const step = Math.min(Math.floor(steps + 1e-9), Math.max(lastStep - 1, 0));
  return { step, next: Math.min(step + 1, lastStep), part: clamp(steps - step, 0, 1) };
}

const between = (values, { step, next, part }) => values[step] + (values[next] - values[step]) * part;

/** A vessel at any time: straight from one step to the next, the bow turning the short way. */
function stateOf(vessel, time) {
  const at = locate(time);
  const turn = ((vessel.heading_deg[at.next] - vessel.heading_deg[at.step] + 540) % 360) - 180;
  const nearest = at.part < 0.5 ? at.step : at.next;
  return {
    north: between(vessel.north_m, at),
    east: between(vessel.east_m, at),
    heading: vessel.heading_deg[at.step] + turn * at.part,
    course: vessel.course_deg[nearest],
    speed: vessel.speed_mps[nearest],
  };
}

function velocityOf(state) {
  return { north: state.speed * Math.cos(radians(state.course)), east: state.speed * Math.sin(radians(state.course)) };
}

/** Range and bearing of a target ship now, and its closest point of approach if both keep their velocities. */
function geometryOf(target, time) {
  const ship = stateOf(own, time);
  const other = stateOf(episode.vessels[target.vessel], time);
  const away = { north: other.north - ship.north, east: other.east - ship.east };
  const [shipMoves, otherMoves] = [velocityOf(ship), velocityOf(other)];
  const closing = { north: otherMoves.north - shipMoves.north, east: otherMoves.east - shipMoves.east };
  const speed = Math.hypot(closing.north, closing.east);
  const range = Math.hypot(away.north, away.east);
  // Speeds are rounded to the millimetre per second.
  const passing = speed > 0.002;
  return {
    ship, other, range,
    bearing: ((Math.atan2(away.east, away.north) * 180) / Math.PI + 360) % 360,
    dcpa: passing ? Math.abs(away.north * closing.east - away.east * closing.north) / speed : range,
    tcpa: passing ? -(away.north * closing.north + away.east * closing.east) / (speed * speed) : 0,
  };
}

/** When the collision circles overlap: pairs of times, exact for straight steps. */
function contactsOf(target) {
  const other = episode.vessels[target.vessel];
  const spans = [];
  for (let step = 0; step < lastStep; step++) {
    const away = [0, 1].map((k) => [other.north_m[step + k] - own.north_m[step + k], other.east_m[step + k] - own.east_m[step + k]]);
    const way = [away[1][0] - away[0][0], away[1][1] - away[0][1]];
    const a = way[0] ** 2 + way[1] ** 2;
    const b = away[0][0] * way[0] + away[0][1] * way[1];
    const c = away[0][0] ** 2 + away[0][1] ** 2 - target.contact_distance_m ** 2;
    const root = Math.sqrt(b * b - a * c);
    let [from, to] = a > 1e-9 ? [(-b - root) / a, (-b + root) / a] : c <= 0 ? [0, 1] : [2, 2];
    [from, to] = [Math.max(from, 0), Math.min(to, 1)];
    // Where the root is not real, neither comparison holds.
    if (!(from <= to)) continue;
    [from, to] = [(step + from) * episode.dt_s, (step + to) * episode.dt_s];
    const last = spans.at(-1);
    if (last && from - last[1] < 0.01) last[1] = to;
    else spans.push([from, to]);
  }
  return spans;
}
for (const target of targets) target.contacts = contactsOf(target);
const inContact = (target, time) => target.contacts.some(([from, to]) => time >= from && time <= to);

const pad = (number) => String(number).padStart(2, "0");
function clockText(seconds) {
  const whole = Math.round(Math.abs(seconds));
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor(whole / 60) % 60;
  const sign = seconds <= -0.5 ? "\u2212" : "";
  return sign + (hours ? `${hours}:${pad(minutes)}` : pad(minutes)) + `:${pad(whole % 60)}`;
}
const metresText = (metres) =>
  metres >= 10000 ? `${(metres / 1000).toFixed(1)} km` : `${metres.toFixed(metres < 10 ? 1 : 0)} m`;
const knotsText = (speed) => `${((speed * 3600) / 1852).toFixed(1)} kn`;
const degreesText = (degrees) => `${String(Math.round(((degrees % 360) + 360) % 360) % 360).padStart(3, "0")}\u00b0`;

/** Colours of the style sheet as they stand now; asked for again when light turns to dark. */
let colours = {};
function readColours() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  colours = Object.fromEntries(
    ["ink", "muted", "panel", "line", "sea", "grid", "grid-ink", "danger", "danger-wash"].map((name) => [name, read(name)]),
  );
  colours.vessels = episode.vessels.map((_, index) => read(`vessel-${index && ((index - 1) % 7) + 1}`));
}

/** A canvas that always has as many pixels as the screen gives it; `draw(context, width, height)`. */
function surface(canvas, draw) {
  const redraw = () => {
    const { width, height } = canvas.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    const [columns, rows] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (!columns || !rows) return;
    if (canvas.width !== columns || canvas.height !== rows) [canvas.width, canvas.height] = [columns, rows];
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    draw(context, width, height);
  };
  new ResizeObserver(redraw).observe(canvas);
  return redraw;
}

/** A round number near `rough`: 1, 2 or 5 times a power of ten. */
function roundStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * ([1, 2, 5].find((factor) => factor * power >= rough) ?? 10);
}
