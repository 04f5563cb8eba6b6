// @ts-check
/** The page: what is shown of the state, and what is asked for. */

import { DrawnPath } from "./draw.js";
import { edits } from "./edit.js";
import { files } from "./files.js";
import { Link } from "./link.js";
import { ChartView, cornersOf, make, middleOf, placeOf } from "./map.js";
import { fill } from "./panel.js";
import { mark } from "./profile.js";
import { Space } from "./space.js";

/** @param {string} id @returns {any} */
const by = (id) => document.getElementById(id);

/** @type {any} What the server said last, and what is chosen here. */
const page = {
  data: null, version: -1, error: null, saved: true, file: null, tour: null, chosen: [], along: 0,
  tool: "select", draft: null, ask: (m) => link.ask(m), edit, redraw, drawTethers, view: null, facts: null,
  inSpace: () => space.open, picked: null, note, wrong: null, undo: false, redo: false,
  drawn: null, download: null, refill: () => fill(page), shown: false, run: false, events: [], refit, go: goTo,
};

const view = new ChartView(by("map"));
page.view = view;
view.onplaced = () => redraw();
const link = new Link(heard);
page.drawn = new DrawnPath(page, link);
const space = new Space(by("space"), link, note);
let fitted = false;

/** Fits the view to a version, now or when it comes. @param {number} version */
function refit(version) {
  fitted = page.version >= version && !space.open;
  if (!fitted) return;
  view.fit(page.data);
  redraw();
}

/** Seconds in which the whole tour is played. */
const LASTS = 24;

/** @param {string} text @param {boolean} bad */
function note(text, bad = false) {
  by("where").textContent = text;
  by("where").className = bad ? "note bad" : "note";
}

/** @param {any} change */
async function edit(change) {
  const answer = await link.ask({ edit: change });
  if (answer.error) note(answer.error, true);
}

/** @param {any} message */
function heard(message) {
  if (message.connected === false) { by("answer").textContent = "the connection to the server is lost; trying again"; return; }
  if (message.state) {
    const other = page.version !== message.state.version;
    Object.assign(page, message.state);
    if (other) {
      if (page.tour && !page.shown) page.tour.stale = true;
      page.facts = page.hovered = page.walked = null;
      page.classes = [];
      page.classesOf = null;
      by("along-said").textContent = "";
      if (page.drawn.any) page.drawn.measure();
    }
    document.body.classList.toggle("shown", page.shown);
    page.chosen = page.chosen.filter(([list, k]) => list === "base" || k < (page.data[list] ?? []).length);
    view.heading = page.data.origin ? page.data.origin.heading ?? 0 : undefined;
    if (!fitted && !space.open) { fitted = true; view.fit(page.data); }
    page.wrong = whatIsWrong();
    fill(page);
  }
  if (message.tour) {
    page.tour = message.tour;
    page.fresh = true;
    page.wrong = whatIsWrong();
    showAlong();
    fill(page);
  }
  if (message.drawn_points) page.drawn.take(message.drawn_points, message.by);
  if (message.facts) { page.facts = message.facts; fill(page); mark(by("along").value / 1000); }
  redraw();
  page.fresh = false;
  say();
}

/** True before the first goal is drawn. */
const isEmpty = () => !page.shown && !(page.data?.goals ?? []).length;

/** Why this version has no tour, which the panel and the status line say. @returns {string | null} */
function whatIsWrong() {
  if (isEmpty()) return null;
  return page.error ?? outOfReach() ?? (page.tour?.version === page.version ? page.tour?.error ?? null : null);
}

function say() {
  const tour = page.tour, answer = by("answer");
  by("name").textContent = `${page.data?.name ?? "netsp"}${page.saved ? "" : " *"}`;
  document.title = `${page.saved ? "" : "* "}${page.data?.name ?? "netsp"}`;
  const wrong = page.wrong;
  answer.classList.toggle("bad", Boolean(wrong));
  if (isEmpty()) answer.textContent = "draw goals and obstacles, or open a file";
  else if (wrong) answer.textContent = wrong;
  else if (page.run && tour) {
    const s = tour.summary;
    const left = (s.left_out ?? []).length;
    answer.textContent = `a run: ${s.visited} visited${left ? `, ${left} left out` : ""}, longest tether `
      + `${s.longest_tether.toFixed(2)} of ${page.data.tether_length} m, over the limit for ${s.exceedance_s.toFixed(1)} s`;
  } else if (!tour || tour.version !== page.version) answer.textContent = "solving …";
  else {
    answer.textContent = `${tour.length.toFixed(2)} m, ${tour.proof}` + (tour.stage === "searching" ? " …" : "");
  }
  answer.title = answer.textContent;
  const walkable = Boolean(tour?.path?.length) && (page.shown || !(tour.error || page.error));
  by("play").disabled = by("along").disabled = !walkable;
  if (!walkable) stop();
  by("undo").disabled = !page.undo;
  by("redo").disabled = !page.redo;
  by("save").disabled = page.saved && page.file !== null;
  by("undo").hidden = by("redo").hidden = by("save").hidden = by("open").hidden = page.shown;
  by("get").hidden = page.shown && !page.plan;
}

/** Which goals the tether does not reach, and what each needs. @returns {string | null} */
function outOfReach() {
  const tour = page.tour;
  const far = tour?.version === page.version ? tour.unreached ?? [] : [];
  if (!far.length) return null;
  const around = (tour.enclosing ?? []).slice(0, 6).map((k) => page.data.obstacles[k]?.name ?? `#${k}`).join(", ");
  const each = far.slice(0, 6).map((f) => `${page.data.goals[f.goal]?.name ?? `#${f.goal}`} `
    + (f.needed === null ? `is shut in${around ? ` by ${around}` : ""}` : `needs ${(Math.ceil(f.needed * 100) / 100).toFixed(2)} m of tether`));
  return `${each.join(", ")}${far.length > 6 ? `, and ${far.length - 6} more` : ""}`
    + (far.some((f) => f.needed !== null) ? `; the tether has ${page.data.tether_length} m` : "");
}

/** @param {number[][]} points */
const line = (points) => points.map((p) => `${p[0]},${p[1]}`).join(" ");

/** Which way the tour goes: an arrow every so many pixels. @param {number[][]} path */
function arrows(path) {
  const out = [];
  let along = 60;
  for (let k = 1; k < path.length; k++) {
    const [ax, ay] = view.toScreen(path[k - 1][0], path[k - 1][1]), [bx, by_] = view.toScreen(path[k][0], path[k][1]);
    const far = Math.hypot(bx - ax, by_ - ay);
    for (; along < far && out.length < 200; along += 130) {
      const f = along / far;
      out.push(make("path", { class: "arrow", d: "M5 0L-4 -4L-2 0L-4 4Z",
        transform: `translate(${ax + f * (bx - ax)} ${ay + f * (by_ - ay)}) rotate(${Math.atan2(by_ - ay, bx - ax) * 180 / Math.PI})` }));
    }
    along -= far;
  }
  return out;
}

/** @param {string} list @param {number} k */
const isChosen = (list, k) => page.chosen.some(([l, n]) => l === list && n === k);

function redraw() {
  const data = page.data;
  if (!data) return;
  const world = [], screen = [];
  const held = new Set(page.drawn.figures?.entangled ?? []);
  const blamed = new Set(page.tour?.enclosing ?? []);
  // what the reason names, as in "base: …" and "goals[3]: … obstacles[0] …"
  const wrong = new Set(page.error?.match(/\bbase\b|\b(?:goals|obstacles)\[\d+\]/g) ?? []);
  if (Array.isArray(data.bounds)) {
    const corners = cornersOf(data.bounds);
    world.push(make("polygon", { points: line(corners), class: `bounds${isChosen("bounds", 0) ? " chosen" : ""}` }));
    if (!page.shown) corners.forEach((p, n) => {
      const [hx, hy] = view.toScreen(p[0], p[1]);
      screen.push(make("rect", { x: hx - 5, y: hy - 5, width: 10, height: 10, class: "handle faint", "data-corner": n, "data-index": -1 }));
    });
  }
  (data.obstacles ?? []).forEach((o, k) => {
    const look = { class: `obstacle${blamed.has(k) ? " blamed" : ""}${held.has(k) ? " held" : ""}${wrong.has(`obstacles[${k}]`) ? " wrong" : ""}${isChosen("obstacles", k) ? " chosen" : ""}`,
      "data-list": "obstacles", "data-index": k };
    if (o.center) {
      world.push(make("circle", { cx: o.center[0], cy: o.center[1], r: o.radius + data.clearance, class: "clearance" }),
        make("circle", { cx: o.center[0], cy: o.center[1], r: o.radius, ...look }));
    } else {
      world.push(make("polygon", { points: line(o.polygon), class: "halo", "stroke-width": 2 * (data.clearance || 0) }),
        make("polygon", { points: line(o.polygon), ...look }));
    }
    const [x, y] = view.toScreen(middleOf(o)[0], middleOf(o)[1]);
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
  if (tour?.planned) world.push(make("polyline", { points: line(tour.planned), class: "tour planned" }));
  if (tour?.path) {
    const stale = tour.stale || tour.version !== page.version;
    world.push(make("polyline", { points: line(tour.path), class: `tour${stale ? " stale" : ""}${page.fresh ? " new" : ""}` }));
  }
  if (tour?.path && tour.version === page.version && !tour.stale) screen.push(...arrows(tour.path));
  const drawn = page.drawn.points;
  if (drawn.length > 1) world.push(make("polyline", { points: line(drawn), class: "drawn" }));
  if (page.tool === "path") for (const [x, y] of drawn.length < 400 ? drawn : []) {
    const [sx, sy] = view.toScreen(x, y);
    screen.push(make("circle", { cx: sx, cy: sy, r: 2.5, class: "drawn-point" }));
  }
  for (const c of page.classes ?? []) world.push(make("polyline", { points: line(c.path), class: "hover" }));
  if (page.draft) world.push(make(page.draft.radius === undefined ? "polyline" : "circle", page.draft.radius === undefined
    ? { points: line(page.draft.points), class: "draft" }
    : { cx: page.draft.x, cy: page.draft.y, r: page.draft.radius, class: "draft" }));
  const far = new Set((tour?.unreached ?? []).map((f) => f.goal));
  const visit = new Map((tour?.visits ?? []).map((v, n) => [v.goal, n + 1]));
  (data.goals ?? []).forEach((g, k) => {
    const [x, y] = view.toScreen(placeOf(g)[0], placeOf(g)[1]);
    const known = tour && !tour.stale && tour.version === page.version;
    screen.push(make("g", { class: `goal${known && far.has(k) ? " unreached" : ""}${wrong.has(`goals[${k}]`) ? " wrong" : ""}`, "data-list": "goals", "data-index": k },
      make("circle", { cx: x, cy: y, r: 9, class: isChosen("goals", k) ? "chosen" : "" }),
      make("text", { x, y: y + 4, "text-anchor": "middle" }, String(known ? visit.get(k) ?? "" : "")),
      make("text", { x: x + 9, y: y - 8, class: "label" }, g.name ?? "")));
  });
  const [bx, by_] = view.toScreen(data.base[0], data.base[1]);
  screen.push(make("path", { class: `base${isChosen("base", 0) ? " chosen" : ""}${wrong.has("base") ? " wrong" : ""}`, "data-list": "base", "data-index": 0,
    d: `M${bx} ${by_ - 11}l3 8h8l-6 5 2 9-7-5-7 5 2-9-6-5h8z` }));
  // for whoever measures: the version that is shown, and that of the tour on it
  view.svg.dataset.version = String(page.version);
  view.svg.dataset.tour = String(tour?.path ? tour.version : "");
  view.world.replaceChildren(...world);
  view.screen.replaceChildren(...screen);
  drawTethers();
}

/** The tethers at the cursor and along the tour, which move while all else stays. */
function drawTethers() {
  const over = [], [px, py] = view.panned;
  /** As the rest of the screen was drawn, before it was shifted. @param {number} x @param {number} y */
  const at = (x, y) => { const [sx, sy] = view.toScreen(x, y); return [sx - px, sy - py]; };
  /** @param {number[][]} path @param {string} look */
  const add = (path, look) => over.push(make("polyline", { class: look, points: path.map((p) => at(p[0], p[1]).join(",")).join(" ") }));
  const path = page.drawn;
  if (page.tool === "path") {
    const shown = path.ahead ?? path.figures;
    if (shown?.tether?.length) add(shown.tether, "tether");
  } else if (page.hovered?.path) add(page.hovered.path, "hover");
  if (page.picked?.path) add(page.picked.path, "picked");
  if (page.walked?.path) add(page.walked.path, "tether");
  if (page.walked && page.walked.x !== undefined) {
    const [x, y] = at(page.walked.x, page.walked.y);
    over.push(make("circle", { cx: x, cy: y, r: 6, class: "robot" }));
  }
  view.over.replaceChildren(...over);
}

function showAlong() {
  if (!page.tour?.path) return;
  const share = by("along").value / 1000;
  mark(share);
  space.update(share);
  link.latest("along", { along: share }, (answer) => {
    page.walked = answer.along;
    const length = answer.along?.length;
    by("along-said").textContent = length == null ? "" : `tether ${length.toFixed(2)} of ${page.data.tether_length} m`
      + (answer.along.time === undefined ? "" : `, ${answer.along.time.toFixed(0)} s, ${answer.along.mode}`);
    drawTethers();
  });
}

by("along").addEventListener("input", showAlong);
let playing = 0;
function stop() {
  cancelAnimationFrame(playing);
  by("play").setAttribute("aria-pressed", "false");
  by("play").textContent = "Play";
}
by("play").addEventListener("click", () => {
  if (by("play").getAttribute("aria-pressed") === "true") { stop(); return; }
  by("play").setAttribute("aria-pressed", "true");
  by("play").textContent = "Pause";
  if (Number(by("along").value) >= 1000) by("along").value = "0";
  let share = Number(by("along").value) / 1000, before = performance.now();
  const go = (/** @type {number} */ now) => {
    share += (now - before) / 1000 / LASTS;
    before = now;
    by("along").value = String(Math.min(Math.round(1000 * share), 1000));
    showAlong();
    if (share >= 1) stop(); else playing = requestAnimationFrame(go);
  };
  playing = requestAnimationFrame(go);
});
by("undo").addEventListener("click", () => link.ask({ undo: true }));
by("redo").addEventListener("click", () => link.ask({ redo: true }));
by("space-on").addEventListener("click", () => {
  const on = !space.open;
  note("");
  by("space-on").setAttribute("aria-pressed", String(on));
  by("map").style.display = on ? "none" : "";
  view.known = undefined;
  if (!on && !fitted && page.data) { fitted = true; view.fit(page.data); }
  space.show(on, () => by("along").value / 1000);
});

/** The slider to a share of the tour. @param {number} share */
function goTo(share) {
  by("along").value = String(Math.round(1000 * share));
  showAlong();
}
by("fit").addEventListener("click", () => page.data && view.fit(page.data));
edits(page, link);
files(page, link, note);
