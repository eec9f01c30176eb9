// Time, controls, and the words around the pictures.

const SPEEDS = [1, 2, 5, 10, 20, 50, 100];
/** How long a replay takes at first, in seconds. */
const WATCH_S = 20;

const player = { time: 0, playing: false, speed: 1, drawn: 0 };
let selected = targets.length
  ? targets.reduce((best, next) => (next.closest_centre_m < best.closest_centre_m ? next : best))
  : null;

const [sceneCanvas, distanceCanvas, slider, clock] = ["scene", "distances", "time", "clock"].map(element);
const paintScene = surface(sceneCanvas, (context, width, height) => {
  if (lastStep >= 0) drawScene(context, width, height, player.time, selected);
});
const paintDistances = surface(distanceCanvas, (context, width, height) => {
  if (lastStep >= 0) drawDistances(context, width, height, player.time, selected);
});

function show() {
  const done = duration ? player.time / duration : 0;
  slider.value = player.time;
  slider.style.setProperty("--done", `calc(9px + ${done} * (100% - 18px))`);
  slider.setAttribute("aria-valuetext", `${clockText(player.time)} of ${clockText(duration)}`);
  clock.replaceChildren(clockText(player.time), make("small", {}, ` / ${clockText(duration)}`));
  element("play").classList.toggle("playing", player.playing);
  element("play").setAttribute("aria-label", player.playing ? "Pause" : "Play");
  element("follow").setAttribute("aria-pressed", camera.mode === "follow");
  showOwn();
  showTargets();
  paintScene();
  paintDistances();
}

function seek(time) {
  player.time = clamp(time, 0, duration);
  show();
}

function stepBy(count) {
  pause();
  const at = player.time / episode.dt_s;
  const next = count > 0 ? Math.floor(at + 1e-6) + count : Math.ceil(at - 1e-6) + count;
  seek(next * episode.dt_s);
}

function play() {
  if (player.time >= duration) player.time = 0;
  player.playing = duration > 0;
  player.drawn = performance.now();
  requestAnimationFrame(tick);
  show();
}

function pause() {
  player.playing = false;
  show();
}

function tick(now) {
  if (!player.playing) return;
  // A page in the background gets no frames; it goes on where it was, not where it would be.
  const passed = clamp((now - player.drawn) / 1000, 0, 0.25);
  player.drawn = now;
  player.time = Math.min(player.time + passed * player.speed, duration);
  if (player.time >= duration) player.playing = false;
  show();
  requestAnimationFrame(tick);
}

function facts(list, entries) {
  list.replaceChildren(...entries.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
}

function showOwn() {
  const state = stateOf(own, player.time);
  facts(element("own"), [
    ["Heading", degreesText(state.heading)],
    ["Course", degreesText(state.course)],
    ["Speed", knotsText(state.speed)],
  ]);
}

/** One button per target ship: pressing it measures to that ship. */
const cards = targets.map((target) => {
  const numbers = Object.fromEntries(["Distance", "Bearing", "DCPA", "TCPA"].map((name) => [name, make("dd")]));
  const list = make("dl");
  list.append(...Object.entries(numbers).map(([name, value]) => make("div", {}, make("dt", {}, name), value)));
  const words = [target.encounter, episode.vessels[target.vessel].motion].filter(Boolean).join(", ");
  const head = make("header", {}, make("strong", {}, target.name), make("em", {}, words));
  const hulls = target.closest_hull_m > 0 ? `hulls ${metresText(target.closest_hull_m)} apart` : "hulls in touch";
  const closest = make("p", {}, "Closest ", make("b", {}, metresText(target.closest_centre_m)), ` at ${clockText(target.closest_centre_time_s)}, ${hulls}`);
  const start = make("p", {}, `At the start DCPA ${metresText(target.start_dcpa_m)}, TCPA ${clockText(target.start_tcpa_s)}`);
  const button = make("button", { type: "button", class: "target" }, head, list, closest, start);
  const touches = [["Collision circles", target.first_circle_contact_s], ["Hulls", target.first_hull_contact_s]];
  for (const [what, time] of touches.filter(([, time]) => time !== null))
    button.append(make("p", { class: "contact" }, make("b", {}, `${what} touch at ${clockText(time)}`)));
  button.style.setProperty("--colour", `var(--vessel-${((target.vessel - 1) % 7) + 1})`);
  button.addEventListener("click", () => {
    selected = target;
    show();
  });
  return { target, button, numbers };
});
element("targets").append(...cards.map((card) => card.button));
if (!cards.length) element("targets").append(make("p", {}, "There is no other vessel in this encounter."));

function showTargets() {
  for (const { target, button, numbers } of cards) {
    const geometry = geometryOf(target, player.time);
    numbers.Distance.textContent = metresText(geometry.range);
    numbers.Distance.classList.toggle("touching", inContact(target, player.time));
    numbers.Bearing.textContent = degreesText(geometry.bearing);
    numbers.DCPA.textContent = metresText(geometry.dcpa);
    numbers.TCPA.textContent = clockText(geometry.tcpa);
    button.setAttribute("aria-pressed", target === selected);
  }
}

function fillPage() {
  element("scenario").textContent = episode.scenario;
  element("description").textContent = episode.description;
  facts(element("facts"), [
    ["Policy", episode.policy],
    ["Seed", episode.seed],
    ["Duration", clockText(duration)],
    ["Step", `${episode.dt_s} s`],
  ]);
  const touched = targets.filter((target) => target.first_circle_contact_s !== null);
  const names = touched.map((target) => target.name).join(", ");
  element("outcome").textContent = lastStep < 0 ? "No steps recorded" : names ? `Contact with ${names}` : "Stayed clear";
  element("outcome").classList.toggle("contact", touched.length > 0);
  element("credit").textContent = `searoom ${episode.version}`;
  sceneCanvas.setAttribute("aria-label", `Chart of the encounter of ${episode.vessels.map((vessel) => vessel.name).join(", ")}, north up`);

  slider.max = duration;
  const share = (time) => `${(100 * time) / (duration || 1)}%`;
  for (const target of targets) {
    for (const [from, to] of target.contacts) {
      const mark = make("i");
      mark.style.left = share(from);
      mark.style.width = share(to - from);
      element("events").append(mark);
    }
    const dot = make("b");
    dot.style.left = share(target.closest_centre_time_s);
    dot.style.background = `var(--vessel-${((target.vessel - 1) % 7) + 1})`;
    element("events").append(dot);
  }

  player.speed = SPEEDS.reduce((best, next) =>
    Math.abs(Math.log(duration / next / WATCH_S)) < Math.abs(Math.log(duration / best / WATCH_S)) ? next : best);
  element("speed").append(...SPEEDS.map((speed) => make("option", { value: speed }, `${speed}\u00d7`)));
  element("speed").value = player.speed;

  for (const layer of layers) {
    const box = make("input", { type: "checkbox" });
    box.checked = layer.shown;
    box.addEventListener("change", () => {
      layer.shown = box.checked;
      paintScene();
    });
    const label = make("label", {}, box);
    const icon = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    icon.setAttribute("viewBox", "0 0 26 14");
    icon.setAttribute("aria-hidden", "true");
    const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
    path.setAttribute("d", layer.icon);
    path.setAttribute("stroke-linecap", "round");
    icon.append(path);
    label.append(icon, layer.text);
    element("layers").append(label);
  }
}

function setMode(mode) {
  camera.mode = camera.mode === mode && mode === "follow" ? "free" : mode;
  show();
}

const keys = {
  " ": () => (player.playing ? pause() : play()),
  ArrowLeft: (event) => stepBy(event.shiftKey ? -10 : -1),
  ArrowRight: (event) => stepBy(event.shiftKey ? 10 : 1),
  Home: () => seek(0),
  End: () => seek(duration),
  "+": () => zoomBy(1 / 1.3),
  "=": () => zoomBy(1 / 1.3),
  "-": () => zoomBy(1.3),
  f: () => setMode("fit"),
  o: () => setMode("follow"),
};

function zoomBy(factor) {
  zoom(factor);
  show();
}

function handleControls() {
  element("play").addEventListener("click", keys[" "]);
  element("back").addEventListener("click", () => stepBy(-1));
  element("forward").addEventListener("click", () => stepBy(1));
  element("zoom-in").addEventListener("click", keys["+"]);
  element("zoom-out").addEventListener("click", keys["-"]);
  element("fit").addEventListener("click", keys.f);
  element("follow").addEventListener("click", keys.o);
  element("speed").addEventListener("change", (event) => (player.speed = Number(event.target.value)));
  slider.addEventListener("input", () => {
    player.playing = false;
    seek(Number(slider.value));
  });
  const scrub = (event) => {
    if (event.type === "pointermove" && event.buttons === 0) return;
    player.playing = false;
    seek(plotArea(distanceCanvas.clientWidth, distanceCanvas.clientHeight).time(event.offsetX));
  };
  for (const kind of ["pointerdown", "pointermove"]) distanceCanvas.addEventListener(kind, scrub);
  handleGestures(sceneCanvas, show);
  document.addEventListener("keydown", (event) => {
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    // Buttons answer the space bar themselves, lists the arrows.
    const own = event.target.closest("select, label") || (event.key === " " && event.target.closest("button"));
    if (!act || own || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    act(event);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    readColours();
    show();
  });
}

readColours();
fillPage();
if (lastStep >= 0) {
  handleControls();
  // `#t=120` opens the replay two minutes in.
  seek(Number(new URLSearchParams(location.hash.slice(1)).get("t")) || 0);
}
