// Distances over time. The square root gives near distances, which matter, the room of far ones.

const margin = { left: 46, right: 12, top: 12, bottom: 24 };

const farthest = targets.reduce(
  (most, target) => target.distance_m.reduce((a, b) => Math.max(a, b), Math.max(most, target.contact_distance_m)),
  1,
);

function plotArea(width, height) {
  const right = width - margin.right;
  const foot = height - margin.bottom;
  return {
    right, foot,
    x: (time) => margin.left + ((right - margin.left) * time) / (duration || 1),
    y: (metres) => foot - (foot - margin.top) * Math.sqrt(clamp(metres, 0, farthest) / farthest),
    time: (x) => clamp(((x - margin.left) / (right - margin.left)) * duration, 0, duration),
  };
}

/** Distances worth a line: round ones, none too close to the one before. */
function distanceTicks(area) {
  const ticks = [0];
  for (const metres of [50, 100, 200, 300, 500, 1000, 2000, 3000, 5000, 10000, 20000, 50000, 100000])
    if (metres <= farthest && area.y(ticks.at(-1)) - area.y(metres) > 26) ticks.push(metres);
  return ticks;
}

function drawDistances(context, width, height, time, selected) {
  const area = plotArea(width, height);
  context.font = "11px system-ui, sans-serif";
  context.lineWidth = 1;
  context.strokeStyle = colours.line;
  context.fillStyle = colours.muted;
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const metres of distanceTicks(area)) {
    const y = Math.round(area.y(metres)) + 0.5;
    stroke(context, [[margin.left, y], [area.right, y]]);
    context.fillText(metres >= 1000 ? `${metres / 1000} km` : `${metres} m`, margin.left - 6, y);
  }
  context.textBaseline = "alphabetic";
  const step = [5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400].find((s) => duration / s <= 6) ?? 43200;
  for (let tick = 0; tick <= duration; tick += step) {
    const text = clockText(tick);
    const half = context.measureText(text).width / 2;
    context.textAlign = "center";
    context.fillText(text, Math.min(area.x(tick), width - half - 1), height - 7);
  }
  if (selected?.contact_distance_m) drawThreshold(context, area, selected.contact_distance_m);
  for (const target of targets) drawDistance(context, area, target, selected);
  drawCursor(context, area, time);
}

/** The distance at which the collision circles of own ship and a target ship touch. */
function drawThreshold(context, area, metres) {
  const y = area.y(metres);
  context.fillStyle = colours["danger-wash"];
  context.fillRect(margin.left, y, area.right - margin.left, area.foot - y);
  context.strokeStyle = context.fillStyle = colours.danger;
  context.setLineDash([5, 4]);
  stroke(context, [[margin.left, y], [area.right, y]]);
  context.setLineDash([]);
  context.textAlign = "left";
  context.fillText(`contact ${metresText(metres)}`, margin.left + 5, y + 13 < area.foot - 2 ? y + 13 : y - 4);
}

function drawDistance(context, area, target, selected) {
  context.strokeStyle = colours.vessels[target.vessel];
  context.globalAlpha = selected && selected !== target ? 0.55 : 1;
  context.lineWidth = selected === target ? 2.4 : 1.6;
  const samples = target.distance_m.map((metres, step) => [step * episode.dt_s, metres]);
  samples.push([target.closest_centre_time_s, target.closest_centre_m]);
  samples.sort((a, b) => a[0] - b[0]);
  stroke(context, samples.map(([time, metres]) => [area.x(time), area.y(metres)]));
  context.beginPath();
  context.arc(area.x(target.closest_centre_time_s), area.y(target.closest_centre_m), 3.6, 0, 2 * Math.PI);
  context.fillStyle = colours.panel;
  context.fill();
  context.stroke();
  context.globalAlpha = 1;
}

function drawCursor(context, area, time) {
  const x = area.x(time);
  context.strokeStyle = colours.ink;
  context.lineWidth = 1;
  stroke(context, [[x, margin.top - 6], [x, area.foot]]);
  for (const target of targets) {
    context.beginPath();
    context.arc(x, area.y(geometryOf(target, time).range), 4, 0, 2 * Math.PI);
    context.fillStyle = colours.vessels[target.vessel];
    context.fill();
    context.strokeStyle = colours.panel;
    context.stroke();
  }
}
