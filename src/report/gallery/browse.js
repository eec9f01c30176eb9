// The table, the list below it, and the replay beside.

const element = (id) => document.getElementById(id);
function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}
const distinct = (values) => [...new Set(values)];
const PAGE_LENGTH = 100;
const OUTCOMES = [
  ["All", () => true],
  ["Contact", (run) => run.contact],
  ["Wrong side", (run) => run.wrong_side],
];
const frame = JSON.parse(element("frame").textContent);

unpack(element("data").textContent).then((gallery) => {
  const text = (number) => gallery.texts[number];
  const runs = gallery.runs.map((run) => {
    const scene = gallery.scenes[run.scene];
    const closest = Math.min(...run.targets.map((target) => target[0]));
    return { ...run, scene_of: scene, policy_name: text(run.policy), tracks: text(scene.tracks), scenario: text(scene.scenario), closest, packed: run };
  });
  // Worst first; at equal outcome in the order of the episodes.
  runs.sort((a, b) => b.contact - a.contact || b.wrong_side - a.wrong_side || a.closest - b.closest);
  const policies = distinct(gallery.runs.map((run) => text(run.policy)));
  const scenarios = distinct(gallery.scenes.map((scene) => text(scene.scenario)));
  const tracks = distinct(gallery.scenes.map((scene) => text(scene.tracks)));
  const sigmas = distinct(runs.map((run) => run.sigma_m)).sort((a, b) => a - b);

  const chosen = { tracks: tracks[0], policy: null, scenario: null, sigma: null, outcome: 0, shown: PAGE_LENGTH, run: null };

  const fits = (run, { tracks, policy, scenario, sigma }) =>
    run.tracks === tracks &&
    (policy === null || run.policy_name === policy) &&
    (scenario === null || run.scenario === scenario) &&
    (sigma === null || run.sigma_m === sigma);

  function choose(change) {
    Object.assign(chosen, { shown: PAGE_LENGTH }, change);
    show();
    const [first] = listed();
    if (first) replay(first);
  }

  function listed() {
    return runs.filter((run) => fits(run, chosen) && OUTCOMES[chosen.outcome][1](run));
  }

  function button(label, pressed, act, attributes = {}) {
    const node = make("button", { type: "button", "aria-pressed": pressed, ...attributes }, label);
    node.addEventListener("click", act);
    return node;
  }

  function showTable() {
    const noise = sigmas.map((sigma) => make("th", { scope: "col" }, `${sigma} m`));
    const head = make(
      "thead",
      {},
      make("tr", {}, make("th"), ...scenarios.map((scenario) => make("th", { scope: "colgroup", colspan: sigmas.length }, scenario))),
      make("tr", {}, make("th", { scope: "col" }, "policy"), ...scenarios.flatMap(() => noise.map((cell) => cell.cloneNode(true)))),
    );
    const body = make("tbody");
    for (const policy of policies) {
      const isRow = chosen.policy === policy && chosen.scenario === null;
      const name = button(policy, isRow, () => choose({ policy: isRow ? null : policy, scenario: null, sigma: null }));
      const cells = scenarios.flatMap((scenario) =>
        sigmas.map((sigma) => {
          const place = { tracks: chosen.tracks, policy, scenario, sigma };
          const here = runs.filter((run) => fits(run, place));
          if (!here.length) return make("td");
          const contacts = here.filter((run) => run.contact).length;
          const share = contacts / here.length;
          const isChosen = chosen.policy === policy && chosen.scenario === scenario && chosen.sigma === sigma;
          const cell = button((100 * share).toFixed(share && share < 0.01 ? 1 : 0), isChosen, () => choose(place), {
            "aria-label": `${policy}, ${scenario}, noise of ${sigma} m: ${contacts} of ${here.length} with contact`,
          });
          cell.style.setProperty("--share", 0.75 * share);
          return make("td", {}, cell);
        }),
      );
      body.append(make("tr", {}, make("th", { scope: "row" }, name), ...cells));
    }
    element("table").replaceChildren(head, body);
  }

  function showList() {
    const all = listed();
    element("count").textContent = `${all.length} episodes, ${all.filter((run) => run.contact).length} with contact`;
    const items = all.slice(0, chosen.shown).map((run) => {
      const facts = [`${run.scenario}, episode ${run.scene_of.number}`, `noise ${run.sigma_m} m`, `return ${run.total_reward}`];
      if (run.wrong_side) facts.push("wrong side");
      const entry = button("", run === chosen.run, () => replay(run));
      entry.classList.toggle("contact", run.contact);
      entry.append(make("b", {}, run.policy_name), make("span", {}, `${run.closest.toFixed(0)} m`), make("small", {}, facts.join(" \u00b7 ")));
      return make("li", {}, entry);
    });
    if (all.length > chosen.shown) {
      const more = button(`Show more of ${all.length}`, false, () => {
        chosen.shown += PAGE_LENGTH;
        showList();
      });
      more.classList.add("more");
      items.push(make("li", {}, more));
    }
    element("episodes").replaceChildren(...items);
  }

  function show() {
    showTable();
    showList();
    const parts = tracks.map((name) => button(`${name} tracks`, name === chosen.tracks, () => choose({ tracks: name })));
    element("tracks").replaceChildren(...(tracks.length > 1 ? parts : []));
    element("outcomes").replaceChildren(...OUTCOMES.map(([name], index) => button(name, index === chosen.outcome, () => choose({ outcome: index }))));
  }

  function replay(run) {
    chosen.run = run;
    showList();
    element("stage-note").textContent = `${run.policy_name}, ${run.scenario}, episode ${run.scene_of.number}, noise of ${run.sigma_m} m`;
    element("replay").srcdoc = pageOf(frame, episodeOf(gallery, run.packed));
  }

  element("title").textContent = gallery.title;
  element("caption").textContent = gallery.caption;
  choose({});
});
