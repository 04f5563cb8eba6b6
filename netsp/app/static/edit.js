// @ts-check
/** Pointer and keys: select, drag, draw, pan, zoom. */

import { cornersOf, metres, middleOf, placeOf, said } from "./map.js";

/** @param {any} page @param {import("./link.js").Link} link */
export function edits(page, link) {
  const svg = document.getElementById("map");
  const where = document.getElementById("where");
  if (!svg || !where) return;
  const view = page.view;
  /** @type {any} */
  let held = null;
  /** @type {Map<number, PointerEvent>} */
  const fingers = new Map();

  /** To a pixel, in decimals. @param {number} v */
  const tidy = (v) => +v.toFixed(Math.min(Math.max(Math.ceil(Math.log10(view.scale)), 0), 9)) || 0;

  /** @param {string} text @param {boolean} bad */
  function tell(text, bad = false) {
    if (!where) return;
    where.textContent = text;
    where.className = bad ? "note bad" : "note";
  }

  /** @param {number[]} p */
  const at_ = (p) => `x ${metres(p[0])}, y ${metres(p[1])} m${earth(/** @type {[number, number]} */ (p))}`;

  const HINTS = {
    goal: "click where the goals are; with keys: arrows move the cross, Space puts a goal there",
    circle: "drag from the centre, or click; with keys: arrows move the cross, Space puts a circle there",
    polygon: "click its corners, then the first one again to finish; with keys: arrows, Space, then Enter",
    path: "click the points of a path, or hold and draw; end the path at the base; Ctrl+Z removes the last stroke",
    bounds: "drag a rectangle",
  };
  /** @param {[number, number]} p @param {MouseEvent} event @returns {[number, number]} */
  const snapped = (p, event) => {
    const step = event.shiftKey ? 1 : 0;
    return step ? [Math.round(p[0] / step) * step, Math.round(p[1] / step) * step] : [tidy(p[0]), tidy(p[1])];
  };

  const finish = document.getElementById("finish");

  /** The polygon that is being drawn becomes an obstacle, if it has three corners. */
  function finished() {
    const polygon = page.draft?.points;
    page.draft = null;
    if (page.tool === "polygon" && polygon?.length >= 3) page.edit({ add: "obstacles", value: { polygon, name: freeName("o") } });
    if (finish) finish.hidden = true;
    page.redraw();
  }
  finish?.addEventListener("click", finished);

  /** A corner of the polygon that is being drawn; the first one again ends it. @param {[number, number]} p */
  function corner(p) {
    page.draft ??= { points: [] };
    const [first] = page.draft.points;
    const near = first && Math.hypot(p[0] - first[0], p[1] - first[1]) * view.scale < 12;
    if (near && page.draft.points.length >= 3) { finished(); return; }
    const last = page.draft.points.at(-1);
    if (last && Math.hypot(p[0] - last[0], p[1] - last[1]) * view.scale < 3) return;
    page.draft.points.push(p);
    if (finish) finish.hidden = page.draft.points.length < 3;
    page.redraw();
  }

  /** @param {string} tool */
  function pick(tool) {
    if (tool !== "polygon" && page.draft) finished();
    tell(HINTS[tool] ?? "");
    page.tool = tool;
    page.draft = null;
    for (const b of document.querySelectorAll("[data-tool]")) {
      b.setAttribute("aria-pressed", String(b.getAttribute("data-tool") === tool));
    }
    page.refill();
    page.redraw();
  }
  for (const b of document.querySelectorAll("[data-tool]")) {
    b.addEventListener("click", () => pick(b.getAttribute("data-tool") ?? "select"));
  }

  /** @param {string} list @param {number} k @param {number} dx @param {number} dy */
  function moved(list, k, dx, dy) {
    if (list === "base") {
      const [x, y, z = 0] = page.data.base;
      return [["base"], [tidy(x + dx), tidy(y + dy), z]];
    }
    const item = page.data[list][k];
    if (list === "goals") {
      const [x, y, z = 0] = placeOf(item);
      const position = [tidy(x + dx), tidy(y + dy), z];
      return [["goals", k], Array.isArray(item) ? position : { ...item, position }];
    }
    if (item.center) return [["obstacles", k], { ...item, center: [tidy(item.center[0] + dx), tidy(item.center[1] + dy)] }];
    return [["obstacles", k], { ...item, polygon: item.polygon.map((p) => [tidy(p[0] + dx), tidy(p[1] + dy)]) }];
  }

  /** Show at once what the server will be told. @param {any[]} path @param {any} value */
  function preview(path, value) {
    if (path.length === 1) page.data = { ...page.data, [path[0]]: value };
    else {
      const items = [...page.data[path[0]]];
      items[path[1]] = value;
      page.data = { ...page.data, [path[0]]: items };
    }
    page.redraw();
  }

  svg.addEventListener("pointerdown", (event) => {
    svg.focus();
    svg.classList.remove("keyed");
    svg.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
    if (fingers.size === 2) { held = null; return; }
    const at = view.toWorld(event);
    if (page.shown) { held = { kind: "pan", x: event.clientX, y: event.clientY }; return; }
    const target = /** @type {Element} */ (event.target);
    const handle = target.closest("[data-corner]");
    const thing = target.closest("[data-list]");
    if (page.tool === "path") {
      held = { kind: "path" };
      page.drawn.begin(snapped(at, event));
    } else if (page.tool === "goal") {
      page.edit({ add: "goals", value: { position: [...snapped(at, event), 0], name: freeName("g") } });
    } else if (page.tool === "bounds") {
      held = { kind: "bounds", from: snapped(at, event) };
      page.draft = { points: [] };
    } else if (page.tool === "circle") {
      const [x, y] = snapped(at, event);
      held = { kind: "circle" };
      page.draft = { x, y, radius: 0 };
    } else if (page.tool === "polygon") {
      corner(snapped(at, event));
    } else if (handle) {
      held = { kind: "corner", index: Number(handle.getAttribute("data-index")), corner: Number(handle.getAttribute("data-corner")) };
    } else if (thing) {
      const own = [thing.getAttribute("data-list"), Number(thing.getAttribute("data-index"))];
      const known = page.chosen.some(([l, k]) => l === own[0] && k === own[1]);
      if (event.shiftKey) page.chosen = known ? page.chosen : [...page.chosen, own];
      else if (!known) page.chosen = [own];
      held = { kind: "move", from: at, before: page.data };
      page.onchosen?.();
      page.redraw();
    } else {
      held = { kind: "pan", x: event.clientX, y: event.clientY };
      if (!event.shiftKey) { page.chosen = []; page.classes = []; page.onchosen?.(); page.redraw(); }
    }
  });

  svg.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    const at = view.toWorld(event);
    if (fingers.size === 2 && before) {
      const other = [...fingers.values()].find((f) => f.pointerId !== event.pointerId);
      if (other) {
        const far = (/** @type {PointerEvent} */ e) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY);
        view.zoom(far(event) / Math.max(far(before), 1), view.toWorld(other));
      }
      fingers.set(event.pointerId, event);
      return;
    }
    if (before) fingers.set(event.pointerId, event);
    if (held?.kind === "path") {
      page.drawn.add(snapped(at, event));
    } else if (held?.kind === "pan") {
      view.pan(-(event.clientX - held.x) / view.scale, (event.clientY - held.y) / view.scale);
      held.x = event.clientX; held.y = event.clientY;
    } else if (held?.kind === "move") {
      page.data = held.before;
      held.changes = page.chosen.map(([l, k]) => moved(l, k, at[0] - held.from[0], at[1] - held.from[1]));
      for (const [path, value] of held.changes) preview(path, value);
    } else if (held?.kind === "corner" && held.index < 0) {
      const p = snapped(at, event), b = page.data.bounds, k = held.corner;
      if (Array.isArray(b[0])) held.value = b.map((q, n) => (n === k ? p : q));
      else {
        const other = cornersOf(b)[(k + 2) % 4];
        held.value = [Math.min(p[0], other[0]), Math.min(p[1], other[1]), Math.max(p[0], other[0]), Math.max(p[1], other[1])];
        page.draft = { points: [...cornersOf(held.value), cornersOf(held.value)[0]] };
      }
      page.redraw();
    } else if (held?.kind === "corner") {
      const o = page.data.obstacles[held.index], p = snapped(at, event);
      held.value = o.center
        ? { ...o, radius: tidy(Math.max(Math.hypot(p[0] - o.center[0], p[1] - o.center[1]), 1e-6)) }
        : { ...o, polygon: o.polygon.map((q, n) => (n === held.corner ? p : q)) };
      preview(["obstacles", held.index], held.value);
    } else if (held?.kind === "bounds") {
      const [[a, b], [c, d]] = [held.from, snapped(at, event)];
      held.value = [Math.min(a, c), Math.min(b, d), Math.max(a, c), Math.max(b, d)];
      page.draft = { points: [[a, b], [c, b], [c, d], [a, d], [a, b]] };
      page.redraw();
    } else if (held?.kind === "circle") {
      page.draft.radius = tidy(Math.hypot(at[0] - page.draft.x, at[1] - page.draft.y));
      page.redraw();
    }
    tell(at_(at));
    if (!held && page.tool === "path") {
      page.drawn.look(at, (text) => tell(`${at_(at)}; ${text}`));
    } else if (!held) {
      link.latest("hover", { hover: at }, (answer) => {
        page.hovered = answer.hover;
        if (answer.hover?.length != null) {
          tell(`${at_([answer.hover.x, answer.hover.y])}; tether ${answer.hover.length.toFixed(2)} m, ${said(page.data, answer.hover.word)}`);
        }
        page.drawTethers();
      });
    }
  });

  /** @param {PointerEvent} event */
  async function released(event) {
    fingers.delete(event.pointerId);
    const was = held;
    held = null;
    if (was?.kind === "pan") view.place();
    if (was?.kind === "path") page.drawn.end();
    if (was?.kind === "move" && was.changes) {
      for (const [path, value] of was.changes) await page.edit({ set: path, value });
    } else if (was?.kind === "corner" && was.value) {
      page.draft = null;
      await page.edit({ set: was.index < 0 ? ["bounds"] : ["obstacles", was.index], value: was.value });
    } else if (was?.kind === "bounds") {
      page.draft = null;
      pick("select");
      const box = was.value;
      if (box && box[0] < box[2] && box[1] < box[3]) await page.edit({ set: ["bounds"], value: box });
      page.redraw();
    } else if (was?.kind === "circle") {
      const { x, y, radius } = page.draft;
      page.draft = null;
      const size = radius * view.scale > 4 ? radius : tidy(30 / view.scale);
      await page.edit({ add: "obstacles", value: { center: [x, y], radius: size, name: freeName("o") } });
      page.redraw();
    }
  }
  svg.addEventListener("pointerup", released);
  svg.addEventListener("pointercancel", released);
  svg.addEventListener("pointerleave", () => { page.hovered = null; page.drawTethers(); });
  svg.addEventListener("wheel", (event) => {
    event.preventDefault();
    view.zoom(Math.exp(-event.deltaY * 0.0015), view.toWorld(event));
  }, { passive: false });

  /** Latitude and longitude under the cursor, near the origin. @param {[number, number]} p */
  function earth(p) {
    const o = page.data?.origin;
    if (!o) return "";
    const turn = (o.heading ?? 0) * Math.PI / 180;
    const [dx, dy] = [p[0] - page.data.base[0], p[1] - page.data.base[1]];
    const east = dx * Math.cos(turn) + dy * Math.sin(turn), north = dy * Math.cos(turn) - dx * Math.sin(turn);
    const lat = o.latitude + north / 111320;
    const lon = o.longitude + east / (111320 * Math.cos(o.latitude * Math.PI / 180));
    return ` (${lat.toFixed(6)}, ${lon.toFixed(6)})`;
  }

  /** @type {Map<string, number>} */
  const given = new Map();

  /** A name that nothing has. @param {string} letter */
  function freeName(letter) {
    const taken = new Set([...(page.data.goals ?? []), ...(page.data.obstacles ?? [])].map((i) => i.name));
    // what was named a moment ago may still be on its way to the server
    for (const [name, when] of given) if (when < Date.now() - 5000) given.delete(name);
    for (let k = 1; ; k++) {
      const name = `${letter}${k}`;
      if (taken.has(name) || given.has(name)) continue;
      given.set(name, Date.now());
      return name;
    }
  }

  page.remove = remove;
  page.duplicate = duplicate;

  function remove() {
    const paths = page.chosen.filter(([l]) => l !== "base").map(([l, k]) => [l, k]);
    page.chosen = [];
    if (paths.length) page.edit({ delete: paths });
  }

  async function duplicate() {
    const step = 40 / view.scale;
    for (const [list, k] of page.chosen) {
      if (list === "base") continue;
      const [, value] = moved(list, k, step, -step);
      await page.edit({ add: list, value: Array.isArray(value) ? value : { ...value, name: freeName(list[0]) } });
    }
  }

  /** Choose what comes next on the map: base, goals, obstacles. @param {number} by */
  function next(by) {
    const every = [["base", 0], ...["goals", "obstacles"].flatMap((l) => (page.data[l] ?? []).map((_, k) => [l, k]))];
    const [list, k] = page.chosen.at(-1) ?? ["", 0];
    const now = every.findIndex(([l, n]) => l === list && n === k);
    const one = every[now < 0 ? (by > 0 ? 0 : every.length - 1) : (now + by + every.length) % every.length];
    page.chosen = [one];
    const item = one[0] === "base" ? null : page.data[one[0]][one[1]];
    const p = item === null ? page.data.base : one[0] === "goals" ? placeOf(item) : middleOf(item);
    tell(`${item === null ? "base" : `${one[0].slice(0, -1)} ${item.name ?? one[1] + 1}`} at ${at_(p)}`);
    page.onchosen?.();
    page.redraw();
  }

  /** Draw with the keys: at the cross in the middle of the map. */
  function atCross() {
    /** @type {[number, number]} */
    const p = [tidy(view.x), tidy(view.y)];
    if (page.tool === "path") { page.drawn.begin(p); page.drawn.end(); }
    else if (page.tool === "goal") page.edit({ add: "goals", value: { position: [...p, 0], name: freeName("g") } });
    else if (page.tool === "circle") page.edit({ add: "obstacles", value: { center: p, radius: tidy(30 / view.scale), name: freeName("o") } });
    else if (page.tool === "polygon") corner(p);
  }

  document.addEventListener("keydown", (event) => {
    if (page.shown && !/^(Arrow|\+|=|-|f|3)/.test(event.key)) return;
    if (/** @type {Element} */ (event.target).closest("input:not([type=range]), select")) return;
    const key = event.key, control = event.ctrlKey || event.metaKey;
    const step = (event.shiftKey ? 60 : 12) / view.scale;
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (control && key.toLowerCase() === "z" && !event.shiftKey && page.tool === "path" && page.drawn.points.length) page.drawn.undo();
    else if (control && key.toLowerCase() === "z") link.ask(event.shiftKey ? { redo: true } : { undo: true });
    else if (control && key.toLowerCase() === "y") link.ask({ redo: true });
    else if (control && key.toLowerCase() === "s") document.getElementById("save")?.click();
    else if (control && key.toLowerCase() === "d") duplicate();
    else if (control) return;
    else if (key === "Delete" || key === "Backspace") remove();
    else if (key === "Escape" && page.inSpace?.()) document.getElementById("space-on")?.click();
    else if (key === "Escape") { page.draft = null; page.chosen = []; page.classes = []; finished(); pick("select"); page.onchosen?.(); }
    else if (key === "Enter" && page.draft?.points?.length >= 3) finished();
    else if (key === "Enter" && page.draft?.points) tell("a polygon needs three corners", true);
    else if (key === " " && document.activeElement === svg && page.tool !== "select") { svg.classList.add("keyed"); atCross(); }
    else if (key.toLowerCase() === "n" && document.activeElement === svg) next(event.shiftKey ? -1 : 1);
    else if (key in ways && document.activeElement === svg) {
      const [dx, dy] = ways[key];
      if (page.chosen.length) {
        for (const [l, k] of page.chosen) { const [path, value] = moved(l, k, dx * step, dy * step); page.edit({ set: path, value }); }
      } else {
        view.x += 4 * dx * step; view.y += 4 * dy * step; view.place();
        svg.classList.add("keyed");
        if (page.tool !== "select") tell(`the cross is at ${at_([view.x, view.y])}`);
      }
    } else if (key === "+" || key === "=") view.zoom(1.25, [view.x, view.y]);
    else if (key === "-") view.zoom(0.8, [view.x, view.y]);
    else if (key === "v") pick("select");
    else if (key === "g") pick("goal");
    else if (key === "c") pick("circle");
    else if (key === "p") pick("polygon");
    else if (key === "b") pick("bounds");
    else if (key === "h") pick("path");
    else if (key === "3") document.getElementById("space-on")?.click();
    else if (key === "f") view.fit(page.data);
    else return;
    event.preventDefault();
  });
}
