// The packed episodes, and a single one of them as the replay page reads it.

const PER_METRE = 10, PER_DEGREE = 10, PER_MPS = 100, PER_DRAW = 100;

async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

/** Undoes differences: each value is the sum of all up to it. */
function sums(values) {
  let sum = 0;
  return values.map((value) => (sum += value));
}
const columnOf = (values, parts) => sums(values).map((value) => value / parts);
const pathOf = (values) => columnOf(sums(values), PER_METRE);

function wayOf(way) {
  return {
    north_m: pathOf(way.north),
    east_m: pathOf(way.east),
    heading_deg: columnOf(way.heading, PER_DEGREE),
    course_deg: columnOf(way.course, PER_DEGREE),
    speed_mps: columnOf(way.speed, PER_MPS),
  };
}

/** Where sensors placed a vessel, one point per step; nothing without noise. */
function observedOf(scene, vessel, way, sigma) {
  const draws = scene.draws[vessel];
  if (!sigma || !draws) return [];
  const error = (axis, step) => (draws[axis][step] / PER_DRAW) * sigma;
  return way.north_m.map((north, step) => [north + error(0, step), way.east_m[step] + error(1, step)]);
}

/** The forecast in force at every step: the latest one made, until the next. */
function aheadOf(scene, sigma, steps) {
  const made = scene.forecasts.filter((forecast) => forecast.sigma_m === sigma);
  if (!made.length) return [];
  const paths = made.map((forecast) => {
    const [north, east] = [0, 1].map((axis) => sums(forecast.points.map((point) => point[axis])));
    return { step: forecast.step, points: north.map((value, index) => [value, east[index]]) };
  });
  return Array.from({ length: steps }, (_, step) => paths.findLast((path) => path.step <= step)?.points ?? []);
}

/** A run with its scene, in the form of the replay page's data. */
function episodeOf(gallery, run) {
  const scene = gallery.scenes[run.scene];
  const text = (number) => (number === null ? null : gallery.texts[number]);
  const ways = [run.way, ...scene.targets.map((target) => target.way)].map(wayOf);
  const vessels = scene.vessels.map((vessel, index) => ({
    name: text(vessel.name),
    motion: text(vessel.motion),
    length_m: vessel.length_m,
    beam_m: vessel.beam_m,
    collision_radius_m: vessel.collision_radius_m,
    hull: vessel.hull,
    ...ways[index],
    observed: observedOf(scene, index, ways[index], run.sigma_m),
    ahead: index === 1 ? aheadOf(scene, run.sigma_m, ways[1].north_m.length) : [],
  }));
  const targets = run.targets.map(([closest, time, hulls, circleContact, hullContact], index) => {
    const way = ways[index + 1];
    return {
      vessel: index + 1,
      name: vessels[index + 1].name,
      encounter: text(scene.targets[index].encounter),
      start_dcpa_m: scene.targets[index].dcpa_m,
      start_tcpa_s: scene.targets[index].tcpa_s,
      closest_centre_m: closest,
      closest_centre_time_s: time,
      closest_hull_m: hulls,
      contact_distance_m: vessels[0].collision_radius_m + vessels[index + 1].collision_radius_m,
      first_circle_contact_s: circleContact,
      first_hull_contact_s: hullContact,
      distance_m: way.north_m.map((north, step) => Math.hypot(north - ways[0].north_m[step], way.east_m[step] - ways[0].east_m[step])),
    };
  });
  return {
    version: gallery.version,
    scenario: text(run.title),
    description: text(scene.description),
    seed: scene.seed,
    policy: text(run.policy),
    dt_s: scene.dt_s,
    vessels,
    targets,
  };
}

/** The replay page of a run: the frame with the episode's data in it. */
function pageOf(frame, episode) {
  const data = JSON.stringify(episode).replace(/[<>&]/g, (letter) => "\\u" + letter.charCodeAt(0).toString(16).padStart(4, "0"));
  // A function, so that no dollar sign in the data means anything.
  return frame.replace("{{episode}}", () => data);
}
