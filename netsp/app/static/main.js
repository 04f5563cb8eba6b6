// @ts-check
/** The page: what is shown of the state, and what is asked for. */

import { edits } from "./edit.js";
import { Link } from "./link.js";
import { ChartView, make, middleOf, placeOf } from "./map.js";
import { fill } from "./panel.js";

/** @param {string} id @returns {any} */
const by = (id) => document.getElementById(id);

/** @type {any} What the server said last, and what is chosen here. */
const page = {
  data: null, version: -1, error: null, saved: true, file: null, tour: null, chosen: [], along: 0,
  tool: "select", draft: null, ask: (m) => link.ask(m), edit, redraw, view: null,
};

const view = new ChartView(by("map"));
page.view = view;
view.onplaced = () => redraw();
const link = new Link(heard);
let fitted = false;

/** @param {any} change */
async function edit(change) {
  const answer = await link.ask({ edit: change });
  if (answer.error) by("where").textContent = answer.error;
}

/** @param {any} message */
function heard(message) {
  if (message.connected === false) by("answer").textContent = "the server is gone; trying again";
  if (message.state) {
    Object.assign(page, message.state);
    if (page.tour) page.tour.stale = true;
    page.chosen = page.chosen.filter(([list, k]) => list === "base" || k < (page.data[list] ?? []).length);
    view.heading = page.data.origin ? page.data.origin.heading ?? 0 : undefined;
    if (!fitted) { fitted = true; view.fit(page.data); }
    fill(page);
  }
  if (message.tour) { page.tour = message.tour; page.fresh = true; showAlong(); fill(page); }
  redraw();
  page.fresh = false;
  say();
}

function say() {
  const tour = page.tour, answer = by("answer");
  by("name").textContent = `${page.data?.name ?? "netsp"}${page.saved ? "" : " *"}`;
  document.title = `${page.saved ? "" : "* "}${page.data?.name ?? "netsp"}`;
  answer.className = page.error || tour?.error ? "bad" : "";
  if (page.error) answer.textContent = page.error;
  else if (tour?.error) answer.textContent = tour.error;
  else if (!tour || tour.version !== page.version) answer.textContent = "solving …";
  else {
    const gap = tour.bound ? 100 * (1 - tour.bound / tour.length) : null;
    answer.textContent = `${tour.length.toFixed(2)} m` + (tour.status === "optimal" ? ", proven shortest"
      : gap === null ? ", searching" : `, at most ${Math.max(gap, 0).toFixed(2)} % above the shortest`)
      + (tour.stage === "searching" ? " …" : "");
  }
  by("save").disabled = page.saved || page.file === null;
  const token = new URLSearchParams(location.search).get("token") ?? "";
  for (const [id, name] of [["get-problem", "problem.json"], ["get-solution", "solution.json"],
    ["get-report", "report.html"]]) by(id).href = `/download/${name}?token=${encodeURIComponent(token)}`;
}

/** @param {number[][]} points */
const line = (points) => points.map((p) => `${p[0]},${p[1]}`).join(" ");

/** @param {string} list @param {number} k */
const isChosen = (list, k) => page.chosen.some(([l, n]) => l === list && n === k);

function redraw() {
  const data = page.data;
  if (!data) return;
  const world = [], screen = [];
  const blamed = new Set(page.tour?.enclosing ?? []);
  if (data.bounds) {
    const [a, b, c, d] = data.bounds;
    world.push(make("rect", { x: a, y: b, width: c - a, height: d - b, class: "bounds" }));
  }
  (data.obstacles ?? []).forEach((o, k) => {
    const look = { class: `obstacle${blamed.has(k) ? " blamed" : ""}${isChosen("obstacles", k) ? " chosen" : ""}`,
      "data-list": "obstacles", "data-index": k };
    if (o.center) {
      world.push(make("circle", { cx: o.center[0], cy: o.center[1], r: o.radius + data.clearance, class: "clearance" }),
        make("circle", { cx: o.center[0], cy: o.center[1], r: o.radius, ...look }));
    } else {
      world.push(make("polygon", { points: line(o.polygon), ...look }));
    }
    const [x, y] = view.toScreen(...middleOf(o));
    if ((data.obstacles ?? []).length <= 60 && o.name) {
      screen.push(make("text", { x, y: y + 4, class: "label", "text-anchor": "middle" }, o.name));
    }
    if (isChosen("obstacles", k)) {
      const corners = o.center ? [[o.center[0] + o.radius, o.center[1]]] : o.polygon;
      corners.forEach((p, n) => {
        const [hx, hy] = view.toScreen(p[0], p[1]);
        screen.push(make("circle", { cx: hx, cy: hy, r: 6, class: "handle", "data-corner": n, "data-index": k }));
      });
    }
  });
  const tour = page.tour;
  if (tour?.path) {
    const stale = tour.stale || tour.version !== page.version;
    world.push(make("polyline", { points: line(tour.path), class: `tour${stale ? " stale" : ""}${page.fresh ? " new" : ""}` }));
  }
  if (page.hovered?.path) world.push(make("polyline", { points: line(page.hovered.path), class: "hover" }));
  for (const c of page.classes ?? []) world.push(make("polyline", { points: line(c.path), class: "hover" }));
  if (page.walked?.path) world.push(make("polyline", { points: line(page.walked.path), class: "tether" }));
  if (page.draft) world.push(make(page.draft.radius === undefined ? "polyline" : "circle", page.draft.radius === undefined
    ? { points: line(page.draft.points), class: "draft" }
    : { cx: page.draft.x, cy: page.draft.y, r: page.draft.radius, class: "draft" }));
  const visit = new Map((tour?.visits ?? []).map((v, n) => [v.goal, n + 1]));
  (data.goals ?? []).forEach((g, k) => {
    const [x, y] = view.toScreen(...placeOf(g).slice(0, 2));
    const known = tour && !tour.stale && tour.version === page.version;
    screen.push(make("g", { class: `goal${tour?.goal === k && known ? " unreached" : ""}`, "data-list": "goals", "data-index": k },
      make("circle", { cx: x, cy: y, r: 9, class: isChosen("goals", k) ? "chosen" : "" }),
      make("text", { x, y: y + 4, "text-anchor": "middle" }, String(known ? visit.get(k) ?? "" : "")),
      make("text", { x: x + 12, y: y + 4, class: "label" }, g.name ?? "")));
  });
  const [bx, by_] = view.toScreen(data.base[0], data.base[1]);
  screen.push(make("path", { class: `base${isChosen("base", 0) ? " chosen" : ""}`, "data-list": "base", "data-index": 0,
    d: `M${bx} ${by_ - 11}l3 8h8l-6 5 2 9-7-5-7 5 2-9-6-5h8z` }));
  if (page.walked && page.walked.x !== undefined) {
    const [x, y] = view.toScreen(page.walked.x, page.walked.y);
    screen.push(make("circle", { cx: x, cy: y, r: 6, class: "handle" }));
  }
  // for whoever measures: the version that is shown, and that of the tour on it
  view.svg.dataset.version = String(page.version);
  view.svg.dataset.tour = String(tour?.path ? tour.version : "");
  view.world.replaceChildren(...world);
  view.screen.replaceChildren(...screen);
}

function showAlong() {
  if (!page.tour?.path) return;
  const share = by("along").value / 1000;
  link.latest("along", { along: share }, (answer) => {
    page.walked = answer.along;
    const length = answer.along?.length;
    by("along-said").textContent = length == null ? "" : `tether ${length.toFixed(2)} of ${page.data.tether_length} m`;
    redraw();
  });
}

by("along").addEventListener("input", showAlong);
let playing = 0;
by("play").addEventListener("click", () => {
  const on = by("play").getAttribute("aria-pressed") !== "true";
  by("play").setAttribute("aria-pressed", String(on));
  clearInterval(playing);
  if (on) playing = setInterval(() => { by("along").value = (Number(by("along").value) + 3) % 1001; showAlong(); }, 50);
});
by("undo").addEventListener("click", () => link.ask({ undo: true }));
by("redo").addEventListener("click", () => link.ask({ redo: true }));
by("save").addEventListener("click", async () => {
  const answer = await link.ask({ save: true });
  by("where").textContent = answer.error ?? `saved as ${page.file}`;
});
by("fit").addEventListener("click", () => page.data && view.fit(page.data));
edits(page, link);
