// The page beside a guard: what it is told is drawn; it says nothing but corrections.

const SVG = "http://www.w3.org/2000/svg";
const TRACK = 3000; // places of the robot that are drawn
const SPAN = 600; // seconds of slack that are drawn

/** @param {string} id */
const byId = (id) => {
  const found = document.getElementById(id);
  if (!found) throw new Error(`no element ${id}`);
  return found;
};

/**
 * @param {Element} parent
 * @param {string} kind
 * @param {Record<string, string | number>} values
 */
function add(parent, kind, values) {
  const made = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(values)) made.setAttribute(name, String(value));
  parent.append(made);
  return made;
}

const site = await (await fetch("site")).json();
byId("name").textContent = `${site.name || "site"}: tether of ${site.tether_length} ${site.units}`;
const map = byId("map");
const far = [site.base, ...site.goals.map((g) => g.position)];
for (const o of site.obstacles) far.push(...o.grown);
const xs = far.map((p) => p[0]);
const ys = far.map((p) => p[1]);
const size = Math.max(Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys), 1);
const edge = 0.08 * size;
const [left, top] = [Math.min(...xs) - edge, -Math.max(...ys) - edge];
const [wide, high] = [
  Math.max(...xs) - Math.min(...xs) + 2 * edge, Math.max(...ys) - Math.min(...ys) + 2 * edge,
];
map.setAttribute("viewBox", `${left} ${top} ${wide} ${high}`);
const unit = size / 120; // what a thing that is drawn without a size measures

/** A round length that divides a span into at most so many parts. @param {number} span @param {number} parts */
const roundStep = (span, parts) => {
  const power = 10 ** Math.floor(Math.log10(span / parts));
  return [1, 2, 5, 10].map((k) => k * power).find((v) => v >= (span / parts) * (1 - 1e-9)) ?? span;
};

/** Grid and numbers along the lower and the left edge, with the names of the axes. */
function drawGrid() {
  const step = roundStep(size, 8);
  const letters = 2.4 * unit;
  const write = (/** @type {number} */ x, /** @type {number} */ y, /** @type {string} */ text, anchor = "middle") => {
    const made = add(map, "text", { x, y, "text-anchor": anchor, class: "axis" });
    /** @type {SVGElement} */ (made).style.fontSize = `${letters}px`;
    made.textContent = text;
  };
  const [right, bottom] = [left + wide, top + high];
  for (let k = Math.ceil(left / step); k * step <= right; k += 1) {
    add(map, "path", { d: `M${k * step} ${top}V${bottom}`, class: "grid", ...thin });
    if (k * step > left + 5 * letters && k * step < right - 3 * letters)
      write(k * step, bottom - 0.4 * letters, `${+(k * step).toPrecision(6)}`);
  }
  for (let k = Math.ceil(-bottom / step); k * step <= -top; k += 1) {
    add(map, "path", { d: `M${left} ${-k * step}H${right}`, class: "grid", ...thin });
    if (-k * step < bottom - 2.5 * letters && -k * step > top + 2.5 * letters)
      write(left + 0.3 * letters, -k * step - 0.2 * letters, `${+(k * step).toPrecision(6)}`, "start");
  }
  write(right - 0.3 * letters, bottom - 0.4 * letters, `x (${site.units})`, "end");
  write(left + 0.3 * letters, top + 1.2 * letters, `y (${site.units})`, "start");
}

/** What the lines and marks mean. */
function drawLegend() {
  const line = (/** @type {string} */ kind) => [["path", { d: "M0 7H18", class: kind }]];
  const star = "M9 1l1.8 4 4.2.3-3.3 2.8 1 4.3L9 10l-3.7 2.4 1-4.3L3 5.3 7.2 5z";
  /** @type {[string, any[][]][]} */
  const marks = [
    ["base", [["path", { d: star, class: "base" }]]],
    ["robot", [["circle", { cx: 9, cy: 7, r: 5, class: "robot" }]]],
    ["tether, taut, in its likeliest class", line("tether")],
    ["in another class that it may be in", line("other")],
    ["gone so far", line("track")],
    ["goal", [["circle", { cx: 9, cy: 7, r: 5, class: "goal" }]]],
    ["obstacle", [["rect", { x: 2, y: 2, width: 14, height: 10, class: "rim" }]]],
    ["clearance", [["rect", { x: 1, y: 1, width: 16, height: 12, class: "grown" }]]],
  ];
  for (const [text, parts] of marks) {
    const item = document.createElement("li");
    const icon = document.createElementNS(SVG, "svg");
    icon.setAttribute("viewBox", "0 0 18 14");
    icon.setAttribute("aria-hidden", "true");
    for (const [kind, values] of parts) add(icon, kind, values);
    item.append(icon, ` ${text}`);
    byId("legend").append(item);
  }
}

/** @param {number[][]} line */
const points = (line) => line.map((p) => `${p[0]},${-p[1]}`).join(" ");
const thin = { "vector-effect": "non-scaling-stroke" };
drawGrid();
drawLegend();
for (const o of site.obstacles) {
  add(map, "polygon", { points: points(o.grown), class: "grown", ...thin });
  add(map, "polygon", { points: points(o.rim), class: "rim", ...thin });
  const below = Math.max(...o.rim.map((/** @type {number[]} */ p) => o.middle[1] - p[1])) + 3.5 * unit;
  const text = add(map, "text", { x: o.middle[0], y: -o.middle[1] + below, "text-anchor": "middle" });
  /** @type {SVGElement} */ (text).style.fontSize = `${2.6 * unit}px`;
  text.textContent = o.name;
}
for (const g of site.goals) {
  add(map, "circle", { cx: g.position[0], cy: -g.position[1], r: unit, class: "goal", ...thin });
}
const star = Array.from({ length: 10 }, (_, k) => {
  const [angle, r] = [Math.PI * (k / 5 - 0.5), (k % 2 ? 0.8 : 2) * unit];
  return `${site.base[0] + r * Math.cos(angle)},${-site.base[1] + r * Math.sin(angle)}`;
});
add(map, "polygon", { points: star.join(" "), class: "base" });
const track = add(map, "polyline", { points: "", class: "track", ...thin });
const others = add(map, "g", {});
const tether = add(map, "polyline", { points: "", class: "tether", ...thin });
const robot = add(map, "circle", { r: 1.4 * unit, cx: site.base[0], cy: -site.base[1], class: "robot", ...thin });
for (const side of site.sides) {
  const option = document.createElement("option");
  option.textContent = side;
  byId("side").append(option);
}
for (const o of site.obstacles) {
  const option = document.createElement("option");
  option.textContent = o.name;
  byId("obstacle").append(option);
}

/** @type {number[][]} */
const walked = [];
/** @type {number[][]} */
const slacks = [];

/** @param {number | null} value @param {string} after */
const told = (value, after) => (value === null || value === undefined ? "–" : `${value.toFixed(1)} ${after}`);

/** @param {any} report */
function show(report) {
  const now = report.classes[0];
  byId("state").textContent = report.claims
    ? report.loops.length ? `looped around ${report.loops.flat().join(", ")}` : "watching"
    : "nothing is claimed: no position";
  const list = byId("alarms");
  list.replaceChildren(...report.alarms.map((a) => {
    const item = document.createElement("li");
    item.className = a.level;
    item.textContent = a.text;
    return item;
  }));
  const units = site.units;
  byId("taut").textContent = now ? told(now.taut, units) : "–";
  byId("slack").textContent = now ? told(now.slack, units) : "–";
  byId("turning").textContent = now ? `${Math.round(now.turning_deg)}°` : "–";
  byId("home").textContent = report.home
    ? `${report.home.length.toFixed(1)} ${units}, ${Math.round(report.home.seconds)} s, back along the tether`
    : "–";
  byId("loop").textContent = report.loop_s === null
    ? "–" : `${Math.round(report.loop_s)} s, around ${report.loop_around.join(", ")}`;
  byId("short").textContent = told(report.short_s, "s");
  byId("position").textContent = report.position
    ? report.position.map((/** @type {number} */ v) => v.toFixed(1)).join(", ") : "–";
  const armed = report.armed === null ? "" : report.armed ? ", armed" : ", disarmed";
  byId("vehicle").textContent = `${report.mode ?? "–"}${armed}`;
  byId("classes").replaceChildren(...report.classes.map((c) => {
    const item = document.createElement("li");
    item.textContent = `${c.passes} (${Math.round(100 * c.likely)} %)`;
    return item;
  }));
  tether.setAttribute("points", now ? points(now.path) : "");
  others.replaceChildren();
  for (const c of report.classes.slice(1)) {
    add(others, "polyline", { points: points(c.path), class: "other", ...thin });
  }
  if (report.position) {
    robot.setAttribute("cx", String(report.position[0]));
    robot.setAttribute("cy", String(-report.position[1]));
    walked.push(report.position);
    if (walked.length > TRACK) walked.shift();
    track.setAttribute("points", points(walked));
  }
  if (now) {
    slacks.push([report.t, now.slack]);
    while (slacks.length && slacks[0][0] < report.t - SPAN) slacks.shift();
    drawSlack();
  }
}

function drawSlack() {
  const chart = byId("slacks");
  const [w, h, margin] = [320, 90, 14];
  chart.setAttribute("viewBox", `0 0 ${w} ${h}`);
  chart.replaceChildren();
  const end = slacks[slacks.length - 1][0];
  const most = site.tether_length;
  const least = Math.min(0, ...slacks.map((s) => s[1]));
  const y = (/** @type {number} */ v) => h - margin - ((v - least) / (most - least)) * (h - 2 * margin);
  const x = (/** @type {number} */ t) => w - ((end - t) / SPAN) * w;
  add(chart, "line", { x1: 0, x2: w, y1: y(0), y2: y(0), class: "zero" });
  add(chart, "polyline", {
    points: slacks.map((s) => `${x(s[0])},${y(s[1])}`).join(" "), class: "tether",
  });
  add(chart, "text", { x: 2, y: 11 }).textContent = `${most} ${site.units}`;
  add(chart, "text", { x: 2, y: h - 2 }).textContent = "10 min ago";
  add(chart, "text", { x: w - 24, y: h - 2 }).textContent = "now";
}

const stream = new EventSource("reports");
stream.onmessage = (event) => show(JSON.parse(event.data));
stream.onerror = () => { byId("state").textContent = "the guard has ended, or cannot be reached"; };

byId("correct").addEventListener("submit", async (event) => {
  event.preventDefault();
  const side = /** @type {HTMLSelectElement} */ (byId("side")).value;
  const obstacle = /** @type {HTMLSelectElement} */ (byId("obstacle")).value;
  const answer = await fetch("correct", { method: "POST", body: JSON.stringify({ side, obstacle }) });
  byId("said").textContent = answer.ok ? `noted: ${side} of ${obstacle}` : "not taken";
});

if (site.events) {
  byId("correct").hidden = true;
  byId("event").hidden = false;
}
byId("event").addEventListener("submit", async (event) => {
  event.preventDefault();
  const kind = /** @type {HTMLSelectElement} */ (byId("kind")).value;
  const text = /** @type {HTMLInputElement} */ (byId("value")).value.trim();
  const numbers = text.split(/[ ,;]+/).map(Number);
  const values = {
    appear: { center: numbers.slice(0, 2), radius: numbers[2] },
    add_goal: numbers,
    cancel_goal: text,
    tether_length: numbers[0],
  };
  const body = JSON.stringify({ [kind]: values[/** @type {keyof typeof values} */ (kind)] });
  const answer = await fetch("event", { method: "POST", body });
  byId("heard").textContent = answer.ok ? `noted: ${body}` : "not taken";
});

export {};
