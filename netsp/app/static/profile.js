// @ts-check
/** Tether out and depth along the tour, over one another; a click takes the slider there. */

import { make, roundStep } from "./map.js";

const WIDE = 330, TALL = 110, LEFT = 38, RIGHT = 6, TOP = 8, BOTTOM = 16;

/** Rows of one chart between its least and most, as points. @param {number[][]} rows @param {number} column
 * @param {number} low @param {number} high */
function curve(rows, column, low, high) {
  return rows.filter((r) => r[column] !== null).map((r) => {
    const x = LEFT + r[0] * (WIDE - LEFT - RIGHT);
    const y = TALL - BOTTOM - (r[column] - low) / Math.max(high - low, 1e-9) * (TALL - TOP - BOTTOM);
    return `${x.toFixed(1)},${y.toFixed(1)}`;
  }).join(" ");
}

/** @param {string} title @param {number[][]} rows @param {number} column @param {number | null} limit
 * @param {number[]} visits @param {string} look @param {(share: number) => void} go */
function chart(title, rows, column, limit, visits, look, go) {
  const values = rows.map((r) => r[column]).filter((v) => v !== null);
  if (!values.length) return [];
  const low = Math.min(...values, limit === null ? Infinity : 0), top = Math.max(...values, limit ?? -Infinity);
  const high = top > low ? top : low + 1;
  const svg = make("svg", { viewBox: `0 0 ${WIDE} ${TALL}`, class: "chart", role: "img", "aria-label": title });
  const y = (/** @type {number} */ v) => TALL - BOTTOM - (v - low) / (high - low) * (TALL - TOP - BOTTOM);
  const step = roundStep((high - low) / 4);
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + 1e-9) + 1e-12; k++) {
    svg.append(make("path", { d: `M${LEFT} ${y(k * step)}H${WIDE - RIGHT}`, class: "grid" }),
      make("text", { x: LEFT - 4, y: y(k * step) + 4, class: "label", "text-anchor": "end" }, String(+(k * step).toPrecision(6))));
  }
  let last = -Infinity;
  visits.forEach((share, n) => {
    const x = LEFT + share * (WIDE - LEFT - RIGHT);
    svg.append(make("path", { d: `M${x} ${TOP}V${TALL - BOTTOM}`, class: "grid" }));
    if (x - last > 14) { last = x; svg.append(make("text", { x, y: TALL - 4, class: "label", "text-anchor": "middle" }, String(n + 1))); }
  });
  if (limit !== null) svg.append(make("path", { d: `M${LEFT} ${y(limit)}H${WIDE - RIGHT}`, class: "limit" }));
  svg.append(make("polyline", { points: curve(rows, column, low, high), class: look }),
    make("path", { class: "now", d: "" }));
  svg.addEventListener("click", (event) => {
    const box = svg.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * WIDE;
    go(Math.min(Math.max((x - LEFT) / (WIDE - LEFT - RIGHT), 0), 1));
  });
  const caption = document.createElement("p");
  caption.className = "note";
  caption.textContent = title;
  return [caption, svg];
}

/** Where the slider is, in every chart. @param {number} share */
export function mark(share) {
  const x = LEFT + share * (WIDE - LEFT - RIGHT);
  for (const line of document.querySelectorAll(".chart .now")) line.setAttribute("d", `M${x} ${TOP}V${TALL - BOTTOM}`);
}

/** @param {any} page @param {(share: number) => void} go @returns {any[]} */
export function profiles(page, go) {
  const rows = page.facts?.profile;
  if (!rows) return [];
  const visits = page.facts.visits ?? [];
  const heading = document.createElement("h2");
  heading.textContent = "Along the tour";
  const parts = [heading, ...chart(`tether out (m), at most ${page.data.tether_length}`, rows, 1, page.data.tether_length, visits, "tether", go)];
  if (rows.some((r) => r[2] !== rows[0][2])) parts.push(...chart("height above the surface (m)", rows, 2, null, visits, "tour", go));
  return parts;
}
