// @ts-check
/** The numbers beside the map. */

import { placeOf } from "./map.js";

/** @param {string} tag @param {any[]} inner */
function element(tag, ...inner) {
  const e = document.createElement(tag);
  e.append(...inner);
  return e;
}

/** @param {string} name @param {any} value @param {(text: string) => void} changed @param {string} kind */
function field(name, value, changed, kind = "number") {
  const input = document.createElement("input");
  input.type = kind;
  if (kind === "number") input.step = "any";
  input.value = value ?? "";
  input.addEventListener("change", () => changed(input.value));
  input.addEventListener("keydown", (event) => { if (event.key === "Enter") input.blur(); });
  return element("label", name, input);
}

/** @param {any} page */
export function fill(page) {
  const panel = document.getElementById("panel");
  if (!panel || !page.data || panel.contains(document.activeElement)) return;
  page.onchosen = () => fill(page);
  const data = page.data, parts = [];
  /** @param {any[]} path @param {any} value */
  const set = (path, value) => page.edit({ set: path, value });
  parts.push(element("h2", "Problem"),
    field("name", data.name, (v) => set(["name"], v), "text"),
    field("tether length (m)", data.tether_length, (v) => set(["tether_length"], Number(v))),
    tetherSlider(page),
    field("clearance (m)", data.clearance, (v) => set(["clearance"], Number(v))),
    field("base depth (m)", -(data.base[2] ?? 0), (v) => set(["base"], [data.base[0], data.base[1], 0 - Number(v)])));
  if (page.tour?.needed) parts.push(element("p", `a tether of ${page.tour.needed.toFixed(2)} m would do`));
  for (const [list, k] of page.chosen.slice(0, 5)) parts.push(...chosen(page, list, k, set));
  const tour = page.tour;
  if (tour?.visits && tour.version === page.version) {
    const rows = tour.visits.map((v, n) => {
      const row = element("tr", element("td", String(n + 1)), element("td", data.goals[v.goal]?.name ?? `#${v.goal}`),
        element("td", v.tether.toFixed(2)), element("td", (data.tether_length - v.tether).toFixed(2)));
      row.addEventListener("click", () => { page.chosen = [["goals", v.goal]]; fill(page); page.redraw(); });
      return row;
    });
    parts.push(element("h2", "Tour"), element("table",
      element("tr", element("th", ""), element("th", "goal"), element("th", "tether"), element("th", "slack")), ...rows));
  }
  panel.replaceChildren(...parts);
}

/** @param {any} page */
function tetherSlider(page) {
  const input = document.createElement("input");
  input.type = "range";
  input.min = "0"; input.max = "1000";
  const length = page.data.tether_length;
  input.value = "500";
  input.setAttribute("aria-label", "tether length");
  let last = 0;
  input.addEventListener("input", () => {
    const now = Date.now();
    if (now < last + 150) return;
    last = now;
    page.edit({ set: ["tether_length"], value: +(length * 2 ** ((Number(input.value) - 500) / 250)).toPrecision(4) });
  });
  input.addEventListener("change", () => {
    page.edit({ set: ["tether_length"], value: +(length * 2 ** ((Number(input.value) - 500) / 250)).toPrecision(4) });
    input.blur();
  });
  return element("label", "", input);
}

/** @param {any} page @param {string} list @param {number} k @param {(path: any[], value: any) => void} set */
function chosen(page, list, k, set) {
  const data = page.data;
  if (list === "base") return [element("h2", "Base"), ...xy(data.base, (p) => set(["base"], [...p, data.base[2] ?? 0]))];
  const item = data[list]?.[k];
  if (!item) return [];
  const named = Array.isArray(item) ? { position: item } : item;
  const rename = field("name", named.name, (v) => set([list, k], { ...named, name: v || undefined }), "text");
  if (list === "goals") {
    const p = placeOf(item);
    const classes = element("button", "Show its classes");
    classes.addEventListener("click", async () => {
      const answer = await page.ask({ classes: k });
      page.classes = answer.classes ?? [];
      const told = page.classes.map((c) => `[${c.word.join(", ")}] ${c.length.toFixed(2)} m`).join("\n");
      list_.textContent = told || "none within the tether's length";
      page.redraw();
    });
    const list_ = element("pre");
    return [element("h2", "Goal"), rename, ...xy(p, (q) => set([list, k], { ...named, position: [...q, p[2] ?? 0] })),
      field("depth (m)", 0 - (p[2] ?? 0), (v) => set([list, k], { ...named, position: [p[0], p[1], 0 - Number(v)] })),
      classes, list_];
  }
  if (item.center) {
    return [element("h2", "Circle"), rename, ...xy(item.center, (q) => set([list, k], { ...item, center: q })),
      field("radius (m)", item.radius, (v) => set([list, k], { ...item, radius: Number(v) }))];
  }
  return [element("h2", `Polygon of ${item.polygon.length} corners`), rename,
    ...item.polygon.slice(0, 12).map((p, n) => field(`corner ${n + 1}`, `${p[0]}, ${p[1]}`, (v) => {
      const corner = v.split(",").map(Number);
      set([list, k], { ...item, polygon: item.polygon.map((q, m) => (m === n ? corner : q)) });
    }, "text"))];
}

/** @param {number[]} p @param {(p: number[]) => void} changed */
function xy(p, changed) {
  return [field("x (m)", p[0], (v) => changed([Number(v), p[1]])), field("y (m)", p[1], (v) => changed([p[0], Number(v)]))];
}
