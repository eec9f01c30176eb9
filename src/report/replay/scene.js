// The chart: where everybody is, was, and is going.

const layers = [
  { id: "trails", text: "Trails", shown: true, icon: "M2 11C8 11 10 3 24 3" },
  { id: "ahead", text: "Ahead", shown: true, icon: "M2 7h3m4 0h3m4 0h3m2-3 3 3-3 3" },
  { id: "circles", text: "Collision circles", shown: true, icon: "M13 1.5a5.5 5.5 0 1 0 .1 0" },
  { id: "observed", text: "Observed positions", shown: true, icon: "M4 5v.1M10 9v.1M16 4v.1M22 8v.1" },
  { id: "closest", text: "Closest approach", shown: true, icon: "M5 4v6M21 4v6M5 7h16" },
  { id: "grid", text: "Grid", shown: true, icon: "M2 4h22M2 10h22M8 1v12M18 1v12" },
].filter((layer) => layer.id !== "observed" || episode.vessels.some((vessel) => vessel.observed.length));
const shows = (id) => layers.some((layer) => layer.id === id && layer.shown);

/** How far ahead straight vectors reach, in seconds. */
const VECTOR_S = 120;
/** Hulls shorter than this on the screen are drawn as a marker of this size, so that nobody is lost. */
const SMALLEST_HULL_PX = 15;

const camera = { north: 0, east: 0, metresPerPixel: 10, mode: "fit", width: 1, height: 1 };

function bounds() {
  const box = { north: [Infinity, -Infinity], east: [Infinity, -Infinity] };
  for (const vessel of episode.vessels)
    for (const axis of ["north", "east"])
      for (const value of vessel[`${axis}_m`]) {
        box[axis][0] = Math.min(box[axis][0], value - vessel.collision_radius_m);
        box[axis][1] = Math.max(box[axis][1], value + vessel.collision_radius_m);
      }
  return box;
}
const everything = bounds();

function aim(time) {
  if (camera.mode === "fit") {
    const { north, east } = everything;
    camera.north = (north[0] + north[1]) / 2;
    camera.east = (east[0] + east[1]) / 2;
    // Room for the readout above, for scale and names below.
    const usable = { width: Math.max(camera.width - 56, 50), height: Math.max(camera.height - 110, 50) };
    camera.metresPerPixel = Math.max((north[1] - north[0]) / usable.height, (east[1] - east[0]) / usable.width, 0.05);
  } else if (camera.mode === "follow") {
    const ship = stateOf(own, time);
    [camera.north, camera.east] = [ship.north, ship.east];
  }
}

const toScreen = (north, east) => [
  camera.width / 2 + (east - camera.east) / camera.metresPerPixel,
  camera.height / 2 - (north - camera.north) / camera.metresPerPixel,
];

function zoom(factor, x = camera.width / 2, y = camera.height / 2) {
  const scale = clamp(camera.metresPerPixel * factor, 0.05, 500);
  if (camera.mode !== "follow") {
    const change = camera.metresPerPixel - scale;
    camera.east += (x - camera.width / 2) * change;
    camera.north -= (y - camera.height / 2) * change;
    camera.mode = "free";
  }
  camera.metresPerPixel = scale;
}

function drawScene(context, width, height, time, selected) {
  [camera.width, camera.height] = [width, height];
  aim(time);
  context.fillStyle = colours.sea;
  context.fillRect(0, 0, width, height);
  context.lineJoin = context.lineCap = "round";
  if (shows("grid")) drawGrid(context);
  episode.vessels.forEach((vessel, index) => drawPath(context, vessel, colours.vessels[index], time));
  if (shows("closest") && selected) drawClosest(context, selected);
  if (selected) drawRange(context, selected, time);
  episode.vessels.forEach((vessel, index) => drawVessel(context, vessel, index, time));
  drawNames(context, time);
  drawNorthAndScale(context);
}

function drawGrid(context) {
  const step = roundStep(camera.metresPerPixel * 90);
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = colours["grid-ink"];
  context.strokeStyle = colours.grid;
  context.lineWidth = 1;
  context.setLineDash([]);
  const label = (metres) => (step >= 1000 ? `${metres / 1000} km` : `${metres} m`).replace("-", "\u2212");
  const halfWidth = (camera.width / 2) * camera.metresPerPixel;
  const halfHeight = (camera.height / 2) * camera.metresPerPixel;
  context.textBaseline = "bottom";
  context.textAlign = "center";
  for (let east = Math.ceil((camera.east - halfWidth) / step) * step; east < camera.east + halfWidth; east += step) {
    const x = Math.round(toScreen(0, east)[0]) + 0.5;
    stroke(context, [[x, 0], [x, camera.height]]);
    if (x > 40 && x < camera.width - 60) context.fillText(label(Math.round(east)), x, camera.height - 3);
  }
  context.textAlign = "left";
  for (let north = Math.ceil((camera.north - halfHeight) / step) * step; north < camera.north + halfHeight; north += step) {
    const y = Math.round(toScreen(north, 0)[1]) + 0.5;
    stroke(context, [[0, y], [camera.width, y]]);
    if (y > 70 && y < camera.height - 60) context.fillText(label(Math.round(north)), 4, y - 1);
  }
}

function stroke(context, points) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x, y));
  context.stroke();
}

function drawPath(context, vessel, colour, time) {
  const { step } = locate(time);
  const now = stateOf(vessel, time);
  const path = (from, to) => vessel.north_m.slice(from, to).map((north, index) => toScreen(north, vessel.east_m[from + index]));
  context.strokeStyle = colour;
  if (shows("trails")) {
    context.globalAlpha = 0.3;
    context.lineWidth = 1;
    context.setLineDash([1, 4]);
    stroke(context, [toScreen(now.north, now.east), ...path(step + 1)]);
    context.setLineDash([]);
    context.globalAlpha = 0.85;
    context.lineWidth = 2;
    stroke(context, [...path(0, step + 1), toScreen(now.north, now.east)]);
  }
  context.globalAlpha = 1;
  if (shows("observed") && vessel.observed.length) {
    context.fillStyle = colour;
    const first = Math.max(0, step - 24);
    for (let index = first; index <= step; index++) {
      const [x, y] = toScreen(...vessel.observed[index]);
      context.globalAlpha = 0.15 + (0.6 * (index - first + 1)) / (step - first + 1);
      context.beginPath();
      context.arc(x, y, 1.8, 0, 2 * Math.PI);
      context.fill();
    }
    context.globalAlpha = 1;
  }
  if (shows("ahead")) drawAhead(context, vessel, now, step);
}

/** The forecast or planned path where there is one, else the present velocity held. */
function drawAhead(context, vessel, now, step) {
  const velocity = velocityOf(now);
  const ahead = vessel.ahead[step]?.length
    ? vessel.ahead[step]
    : [[now.north + velocity.north * VECTOR_S, now.east + velocity.east * VECTOR_S]];
  const points = [[now.north, now.east], ...ahead].map((point) => toScreen(...point));
  context.lineWidth = 1.5;
  context.setLineDash([6, 5]);
  stroke(context, points);
  context.setLineDash([]);
  const [tip, before] = [points.at(-1), points.at(-2)];
  if (Math.hypot(tip[0] - before[0], tip[1] - before[1]) < 2 && points.length === 2) return;
  const angle = Math.atan2(tip[1] - before[1], tip[0] - before[0]);
  const barb = (turn) => [tip[0] - 7 * Math.cos(angle + turn), tip[1] - 7 * Math.sin(angle + turn)];
  stroke(context, [barb(0.45), tip, barb(-0.45)]);
}

/** Where both vessels were when they were closest, in the whole episode. */
function drawClosest(context, target) {
  const ends = [own, episode.vessels[target.vessel]].map((vessel) => stateOf(vessel, target.closest_centre_time_s));
  const points = ends.map((state) => toScreen(state.north, state.east));
  context.strokeStyle = context.fillStyle = colours.ink;
  context.lineWidth = 1.2;
  stroke(context, points);
  for (const [x, y] of points) {
    context.beginPath();
    context.arc(x, y, 3.2, 0, 2 * Math.PI);
    context.fillStyle = colours.sea;
    context.fill();
    context.stroke();
  }
}

function drawRange(context, target, time) {
  const ends = [own, episode.vessels[target.vessel]].map((vessel) => stateOf(vessel, time));
  context.strokeStyle = inContact(target, time) ? colours.danger : colours.muted;
  context.lineWidth = 1;
  context.setLineDash([2, 4]);
  stroke(context, ends.map((state) => toScreen(state.north, state.east)));
  context.setLineDash([]);
}

function drawVessel(context, vessel, index, time) {
  const state = stateOf(vessel, time);
  const [x, y] = toScreen(state.north, state.east);
  const colour = colours.vessels[index];
  const touching = targets.some((target) => (index === 0 || target.vessel === index) && inContact(target, time));
  if (shows("circles") && vessel.collision_radius_m > 0) {
    context.beginPath();
    context.arc(x, y, vessel.collision_radius_m / camera.metresPerPixel, 0, 2 * Math.PI);
    context.globalAlpha = touching ? 1 : 0.1;
    context.fillStyle = touching ? colours["danger-wash"] : colour;
    context.fill();
    context.globalAlpha = touching ? 1 : 0.7;
    context.strokeStyle = touching ? colours.danger : colour;
    context.lineWidth = touching ? 2 : 1.2;
    context.stroke();
    context.globalAlpha = 1;
  }
  const heading = radians(state.heading);
  const scale = 1 / camera.metresPerPixel;
  const corner = ([forward, starboard]) => [
    x + (forward * Math.sin(heading) + starboard * Math.cos(heading)) * scale,
    y - (forward * Math.cos(heading) - starboard * Math.sin(heading)) * scale,
  ];
  let outline = vessel.hull;
  if (vessel.length_m * scale < SMALLEST_HULL_PX || outline.length < 3) {
    const unit = SMALLEST_HULL_PX / scale;
    outline = [[0.62 * unit, 0], [-0.5 * unit, 0.4 * unit], [-0.26 * unit, 0], [-0.5 * unit, -0.4 * unit]];
  }
  context.beginPath();
  outline.forEach((point) => context.lineTo(...corner(point)));
  context.closePath();
  context.fillStyle = colour;
  context.fill();
  context.strokeStyle = colours.panel;
  context.lineWidth = 1.2;
  context.stroke();
}

/** Names beside the vessels, each where it hides the least. */
function drawNames(context, time) {
  context.font = "600 12px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.textAlign = "left";
  context.lineWidth = 3.5;
  // Readings and buttons lie over the chart's upper corners, scale and north arrow in its lower ones.
  const taken = [[0, 0, 205, 64], [camera.width - 56, 0, 56, 200], [camera.width - 50, camera.height - 90, 50, 90], [0, camera.height - 55, 150, 55]];
  for (const vessel of episode.vessels) {
    const state = stateOf(vessel, time);
    const [x, y] = toScreen(state.north, state.east);
    taken.push([x - 8, y - 8, 16, 16]);
  }
  episode.vessels.forEach((vessel, index) => {
    const state = stateOf(vessel, time);
    const [x, y] = toScreen(state.north, state.east);
    if (x < -20 || y < -20 || x > camera.width + 20 || y > camera.height + 20) return;
    const width = context.measureText(vessel.name).width;
    // Clear of the hull as it lies, and of the circle while that is small.
    const radius = shows("circles") ? vessel.collision_radius_m / camera.metresPerPixel : 0;
    const clear = (along, across) => {
      const hull = (0.5 * (vessel.length_m * Math.abs(along) + vessel.beam_m * Math.abs(across))) / camera.metresPerPixel;
      return Math.max(12, hull + 8, radius < 60 ? radius + 5 : 0);
    };
    const [sine, cosine] = [Math.sin(radians(state.heading)), Math.cos(radians(state.heading))];
    const [aside, above] = [clear(sine, cosine), clear(cosine, sine) + 8];
    const places = [[x + aside, y], [x - aside - width, y], [x - width / 2, y - above], [x - width / 2, y + above]];
    const cost = ([left, middle]) => {
      const outside = left < 4 || left + width > camera.width - 4 || middle < 12 || middle > camera.height - 12;
      const hits = taken.filter(([a, b, w, h]) => left < a + w && a < left + width && middle - 8 < b + h && b < middle + 8);
      return hits.length + (outside ? 10 : 0);
    };
    const place = places.reduce((best, next) => (cost(next) < cost(best) ? next : best));
    taken.push([place[0], place[1] - 8, width, 16]);
    context.strokeStyle = colours.sea;
    context.strokeText(vessel.name, ...place);
    context.fillStyle = colours.vessels[index];
    context.fillText(vessel.name, ...place);
  });
}

function drawNorthAndScale(context) {
  const right = camera.width - 30;
  const foot = camera.height - 30;
  context.strokeStyle = context.fillStyle = colours.ink;
  context.lineWidth = 1.5;
  context.setLineDash([]);
  context.beginPath();
  [[right, foot - 34], [right + 7, foot - 10], [right, foot - 16]].forEach((point) => context.lineTo(...point));
  context.closePath();
  context.fill();
  context.beginPath();
  [[right, foot - 34], [right - 7, foot - 10], [right, foot - 16]].forEach((point) => context.lineTo(...point));
  context.closePath();
  context.stroke();
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "alphabetic";
  context.fillText("N", right, foot - 40);

  const metres = roundStep(camera.metresPerPixel * Math.min(90, camera.width / 5));
  const length = metres / camera.metresPerPixel;
  const left = 16;
  const line = camera.height - 30;
  context.lineWidth = 2;
  stroke(context, [[left, line - 5], [left, line], [left + length, line], [left + length, line - 5]]);
  context.textAlign = "left";
  context.fillText(metres >= 1000 ? `${metres / 1000} km` : `${metres} m`, left + 4, line - 7);
}

/** Drag to move, two fingers or the wheel to zoom; `changed()` asks for a new picture. */
function handleGestures(canvas, changed) {
  const fingers = new Map();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return { distance: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
  };
  const at = (event) => ({ x: event.offsetX, y: event.offsetY });
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = fingers.size === 2 ? spread() : fingers.get(event.pointerId);
    fingers.set(event.pointerId, at(event));
    const after = fingers.size === 2 ? spread() : at(event);
    if (camera.mode !== "follow" || fingers.size === 1) {
      camera.mode = "free";
      camera.east -= (after.x - before.x) * camera.metresPerPixel;
      camera.north += (after.y - before.y) * camera.metresPerPixel;
    }
    if (fingers.size === 2 && after.distance > 0) zoom(before.distance / after.distance, after.x, after.y);
    changed();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      zoom(Math.exp(clamp(event.deltaY, -120, 120) * 0.002), event.offsetX, event.offsetY);
      changed();
    },
    { passive: false },
  );
}
