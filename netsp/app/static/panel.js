// @ts-check
/** The numbers beside the map. */

import { metres, placeOf, said } from "./map.js";
import { profiles } from "./profile.js";

/** @param {string} tag @param {any[]} inner */
function element(tag, ...inner) {
  const e = document.createElement(tag);
  e.append(...inner);
  return e;
}

/** Says why a number was not taken. @type {(text: string, bad?: boolean) => void} */
let complain = () => {};

/** @param {string} name @param {any} value @param {(text: string) => void} changed @param {string} kind
 * @param {(v: number) => boolean} good @param {string} expected */
function field(name, value, changed, kind = "number", good = () => true, expected = "a number") {
  const input = document.createElement("input");
  input.type = kind;
  if (kind === "number") input.step = "any";
  input.value = typeof value === "number" ? String(+value.toFixed(4)) : value ?? "";
  const before = input.value;
  input.addEventListener("change", () => {
    const v = Number(input.value);
    if (kind !== "number" || (input.value !== "" && Number.isFinite(v) && good(v))) changed(input.value);
    else {
      complain(`${name}: expected ${expected}, got ${input.value === "" ? "nothing" : input.value}`, true);
      input.value = before;
    }
  });
  input.addEventListener("keydown", (event) => { if (event.key === "Enter") input.blur(); });
  return element("label", name, input);
}

/** @param {any} page */
export function fill(page) {
  const panel = document.getElementById("panel");
  if (!panel || !page.data) return;
  showReason(panel, page);
  const at = document.activeElement;
  if (at && panel.contains(at) && (at.matches("input") || at.closest(".classes"))) return;  // somebody is typing
  page.onchosen = () => fill(page);
  const data = page.data, parts = [];
  complain = page.note;
  /** @param {any[]} path @param {any} value */
  const set = (path, value) => page.edit({ set: path, value });
  if (page.shown) {
    parts.push(element("h2", data.name ?? ""), element("p", `tether ${data.tether_length} m, clearance ${data.clearance} m`));
    if (page.events.length) {
      parts.push(element("h2", "Events"), element("ul", ...page.events.map((e) => element("li", `${(+e.time).toFixed(0)} s, ${e.event}: ${e.text}`))));
    }
  } else {
    parts.push(element("h2", "Problem"),
      field("name", data.name, (v) => set(["name"], v), "text"),
      field("tether length (m)", data.tether_length, (v) => set(["tether_length"], Number(v)), "number", (v) => v > 0, "a length greater than 0"),
      ...tetherSlider(page, set),
      field("clearance (m)", data.clearance, (v) => set(["clearance"], Number(v)), "number", (v) => v >= 0, "a distance of 0 or more"),
      field("base depth (m)", 0 - (data.base[2] ?? 0), (v) => set(["base"], [data.base[0], data.base[1], 0 - Number(v)])),
      ...bounds(data, set));
    for (const [list, k] of page.chosen.slice(0, 5)) parts.push(...chosen(page, list, k, set));
    if (page.chosen.some(([l]) => l !== "base")) parts.push(...copying(page));
  }
  const tour = page.tour;
  if (tour?.visits?.length && tour.version === page.version) {
    const rows = tour.visits.map((v, n) => {
      const row = element("tr", element("td", String(n + 1)), element("td", data.goals[v.goal]?.name ?? `#${v.goal}`),
        element("td", v.tether.toFixed(2)), element("td", (data.tether_length - v.tether).toFixed(2)));
      row.addEventListener("click", () => { page.chosen = [["goals", v.goal]]; fill(page); page.redraw(); });
      return row;
    });
    parts.push(element("h2", "Tour"), element("table",
      element("tr", element("th", ""), element("th", "goal"), element("th", "tether m"), element("th", "slack m")), ...rows));
  }
  parts.push(...drawn(page), ...profiles(page, page.go), ...margins(page), ...imported(page, set));
  if (!page.shown) parts.push(...origin(data, set));
  panel.replaceChildren(...parts);
  showReason(panel, page);
}

/** Says at the top of the panel why there is no tour, also while somebody is typing.
 * @param {HTMLElement} panel @param {any} page */
function showReason(panel, page) {
  const first = panel.firstElementChild;
  const is = Boolean(first?.matches("p.bad")), text = page.shown ? null : page.wrong;
  if (is && first?.textContent === text) return;
  if (is) first?.remove();
  if (!text) return;
  const p = element("p", text);
  p.className = "bad";
  panel.prepend(p);
}

/** @param {string} text @param {boolean} disabled */
function button(text, disabled) {
  const e = document.createElement("button");
  e.append(text);
  e.disabled = disabled;
  return e;
}

/** A path drawn by hand, beside the tour. @param {any} page */
function drawn(page) {
  const path = page.drawn;
  if (!path?.points.length && page.tool !== "path") return [];
  const back = button("Take back", !path.points.length), none = button("Clear", !path.points.length);
  const save = button("Download", !path.any);
  back.title = "Remove the last stroke (Ctrl+Z)";
  save.title = "Download as GeoJSON, which netsp compare-path reads";
  back.addEventListener("click", () => path.undo());
  none.addEventListener("click", () => path.clear());
  save.addEventListener("click", () => page.download("drawn.geojson"));
  const rows = path.rows().map(([name, value, bad]) => {
    const cell = element("td", value);
    if (bad) cell.className = "bad";
    return element("tr", element("th", name), cell);
  });
  const table = element("table", ...rows);
  table.id = "drawn";
  const hint = path.points.length ? [] : [element("p", "Click the points of a path on the map, or hold and draw; it begins at the base.")];
  return [element("h2", "Path by hand"), ...hint, table, element("div", back, " ", none, " ", save)];
}

/** Build the section on an imported map: a table of its layers, the notes, and a field for depths.
 * @param {any} page @param {(path: any[], value: any) => void} set */
function imported(page, set) {
  const site = page.data.site, goals = page.data.goals ?? [];
  if (!site?.imported?.length) return [];
  const notes = (page.notes ?? []).map((/** @type {string} */ text) => element("li", text));
  const list = element("ul", ...notes);
  list.className = "notes";
  const edited = site.edited ? [element("p", "The map was edited after the import; the table shows it as imported.")] : [];
  const depths = new Set(goals.map((/** @type {any} */ g) => 0 - (placeOf(g)[2] ?? 0)));
  const sink = (/** @type {string} */ v) => set(["goals"], goals.map((/** @type {any} */ g) => {
    const at = [placeOf(g)[0], placeOf(g)[1], 0 - Number(v)];
    return Array.isArray(g) ? at : { ...g, position: at };
  }));
  const depth = page.shown || !goals.length ? []
    : [field("depth of all goals (m)", depths.size === 1 ? [...depths][0] : null, sink, "number", (v) => v >= 0, "a depth of 0 or more")];
  const rows = site.imported.flatMap((layer) => {
    const used = Object.entries(layer.used).map(([kind, n]) => `${n} ${kind}`).join(", ");
    const first = element("tr", element("td", layer.layer || "(all)"), element("td", String(layer.features)), element("td", used || "–"));
    const out = layer.left_out.map((group) => {
      const cell = element("td", `${group.features} left out: ${group.reason}`);
      cell.setAttribute("colspan", "3");
      return element("tr", cell);
    });
    return [first, ...out];
  });
  const table = element("table", element("tr", ...["layer", "features", "used as"].map((n) => element("th", n))), ...rows);
  table.className = "imported";
  return [element("h2", `Map: ${site.file}`), table, ...edited, ...(notes.length ? [list] : []), ...depth];
}

/** How far the world may be off. @param {any} page */
function margins(page) {
  const m = page.facts?.margins;
  if (!m) return [];
  const stops = m.stops.map((s) => element("tr", element("td", ""), element("td", s.name), element("td", s.slack.toFixed(2)),
    element("td", (s.turning * 180 / Math.PI).toFixed(0)), element("td", s.clearance?.toFixed(2) ?? "")));
  return [element("h2", "Margins"),
    element("p", (m.obstacles === null ? "There are no obstacles; "
      : `Any one of these is harmless: every obstacle out of place by up to ${m.obstacles.toFixed(2)} m (${m.limited_by}), the robot off its path by ${m.cross_track?.toFixed(2) ?? "any number of"} m, `)
      + `a tether shorter by ${m.tether.toFixed(2)} m.`),
    element("table", element("tr", element("th", ""), element("th", "goal"), element("th", "slack m"), element("th", "turns °"), element("th", "clear m")), ...stops)];
}

/** For whoever has no keyboard. @param {any} page */
function copying(page) {
  const copy = element("button", "Duplicate"), away = element("button", "Delete");
  copy.addEventListener("click", () => page.duplicate());
  away.addEventListener("click", () => page.remove());
  const row = element("div", copy, " ", away);
  return [row];
}

/** Where on the earth the base is: what missions and GeoJSON need.
 * @param {any} data @param {(path: any[], value: any) => void} set */
function origin(data, set) {
  const o = data.origin ?? {};
  const keep = (/** @type {any} */ change) => {
    const next = { heading: 0, ...o, ...pending, ...change };
    pending = next;
    if (next.latitude !== undefined && next.longitude !== undefined) {
      pending = {};
      complain("");
      set(["origin"], next);
    }
    else complain(`position of the base: the ${next.latitude === undefined ? "latitude" : "longitude"} is needed, too`);
  };
  return [element("h2", "Position of the base"),
    field("latitude (°)", o.latitude ?? pending.latitude, (v) => keep({ latitude: Number(v) }), "number", (v) => Math.abs(v) <= 90, "-90 to 90"),
    field("longitude (°)", o.longitude ?? pending.longitude, (v) => keep({ longitude: Number(v) }), "number", (v) => Math.abs(v) <= 180, "-180 to 180"),
    field("bearing of the y axis (°)", o.heading ?? 0, (v) => keep({ heading: Number(v) }), "number", (v) => Math.abs(v) <= 360, "-360 to 360")];
}

/** Latitude or longitude while the other is still missing. @type {any} */
let pending = {};

/** @param {any} data @param {(path: any[], value: any) => void} set */
function bounds(data, set) {
  const b = data.bounds;
  if (!Array.isArray(b)) return [];
  const none = element("button", "Remove the bounds");
  none.addEventListener("click", () => set(["bounds"], null));
  if (Array.isArray(b[0])) return [element("h2", `Bounds of ${b.length} corners`), none];
  return [element("h2", "Bounds"), ...["left (m)", "bottom (m)", "right (m)", "top (m)"].map((name, k) => field(name, b[k],
    (v) => set(["bounds"], b.map((w, n) => (n === k ? Number(v) : w))))), none];
}

/** The tether's length, and the shortest that is enough marked on it.
 * @param {any} page @param {(path: any[], value: any) => void} set */
function tetherSlider(page, set) {
  const length = page.data.tether_length;
  if (!(length > 0)) return [];
  const least = page.facts?.sufficient ?? page.tour?.needed ?? null;
  page.range = page.range && page.range[0] < length && length < page.range[1] ? page.range : [0, 2 * length];
  if (least !== null && least * 1.2 > page.range[1]) page.range = [0, 2 * least];
  const [low, high] = page.range;
  const input = document.createElement("input");
  input.type = "range";
  input.min = "0"; input.max = "1000";
  input.value = String(1000 * (length - low) / (high - low));
  input.setAttribute("aria-label", "tether length");
  const value = () => +(low + (high - low) * Math.max(Number(input.value), 1) / 1000).toPrecision(4);
  // one slide is one version, however often it is solved on the way
  let last = 0, slide = 0;
  const slid = () => page.edit({ set: ["tether_length"], value: value(), merge: slide ||= Date.now() });
  input.addEventListener("input", () => {
    if (Date.now() < last + 150) return;
    last = Date.now();
    slid();
  });
  input.addEventListener("change", () => { slid(); slide = 0; input.blur(); });
  const row = element("label", "", input);
  if (least === null) return [row];
  const marked = document.createElement("datalist");
  marked.id = "least";
  const option = document.createElement("option");
  option.value = String(1000 * (least - low) / (high - low));
  marked.append(option);
  input.setAttribute("list", "least");
  const enough = Math.ceil(least * 100 + 1e-6) / 100;
  const take = element("button", `shortest that reaches every goal: ${enough.toFixed(2)} m`);
  take.title = "with this length the tour may be different, and longer";
  take.addEventListener("click", () => set(["tether_length"], enough));
  return [row, marked, take];
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
    const classes = element("button", "All classes of its tether");
    const list_ = element("div");
    classes.addEventListener("click", async () => {
      const answer = await page.ask({ classes: k });
      Object.assign(page, { classes: answer.classes ?? [], classesOf: k, classCount: answer.count ?? 0 });
      listed();
      page.redraw();
    });
    const listed = () => {
      const its = page.tour?.version === page.version ? page.tour.visits?.find((v) => v.goal === k)?.word : null;
      const rows = page.classes.map((c) => {
        const marks = [c === page.classes[0] ? "shortest" : "", its && its.join() === c.word.join() ? "the tour's" : ""].filter(Boolean);
        const row = element("button", `${metres(c.length)} m, ${said(data, c.word)}${marks.length ? ` (${marks.join(", ")})` : ""}`);
        const show = (/** @type {any} */ what) => () => { page.picked = what; page.drawTethers(); };
        row.addEventListener("pointerenter", show(c));
        row.addEventListener("focus", show(c));
        row.addEventListener("pointerleave", show(null));
        row.addEventListener("blur", show(null));
        return row;
      });
      const more = page.classCount > rows.length ? [element("p", `the ${rows.length} shortest of ${page.classCount}`)] : [];
      list_.replaceChildren(...more, ...(rows.length ? rows : ["none within the tether's length"]));
      list_.className = "classes";
    };
    if (page.classesOf === k && page.classes?.length) listed();
    return [element("h2", "Goal"), rename, ...xy(p, (q) => set([list, k], { ...named, position: [...q, p[2] ?? 0] })),
      field("depth (m)", 0 - (p[2] ?? 0), (v) => set([list, k], { ...named, position: [p[0], p[1], 0 - Number(v)] })),
      classes, list_];
  }
  if (item.center) {
    return [element("h2", "Circle"), rename, ...xy(item.center, (q) => set([list, k], { ...item, center: q })),
      field("radius (m)", item.radius, (v) => set([list, k], { ...item, radius: Number(v) }), "number", (v) => v > 0, "a radius greater than 0")];
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
