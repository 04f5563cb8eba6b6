// @ts-check
/** The map: local metres with equal axes; what is drawn, and where things are on the screen. */

const NS = "http://www.w3.org/2000/svg";

/** @param {string} tag @param {Record<string, any>} attributes @param {any[]} inner */
export function make(tag, attributes = {}, ...inner) {
  const element = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  for (const child of inner) element.append(child);
  return element;
}

/** A round step: 1, 2 or 5 times a power of ten. @param {number} least */
export function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  for (const k of [1, 2, 5, 10]) if (power * k >= least * (1 - 1e-9)) return power * k;
  return power * 10;
}

/** @param {any} goal @returns {number[]} */
export const placeOf = (goal) => (Array.isArray(goal) ? goal : goal.position);

/** @param {any} obstacle @returns {number[]} */
export function middleOf(obstacle) {
  if (obstacle.center) return obstacle.center;
  const n = obstacle.polygon.length;
  return [0, 1].map((k) => obstacle.polygon.reduce((sum, p) => sum + p[k], 0) / n);
}

/** Corners of the bounds, a box or an outline. @param {any} bounds @returns {number[][]} */
export function cornersOf(bounds) {
  if (Array.isArray(bounds[0])) return bounds;
  const [a, b, c, d] = bounds;
  return [[a, b], [c, b], [c, d], [a, d]];
}

/** In centimetres, without a negative zero. @param {number} v */
export const metres = (v) => (Math.abs(v) < 0.005 ? 0 : v).toFixed(2);

/** A word of the tether's class by the names of the obstacles: between which of them and infinity
 * (above them) it passes, a minus for leftwards. @param {any} data @param {number[]} word */
export function said(data, word) {
  if (!word.length) return "class –";
  const name = (/** @type {number} */ letter) => `${letter < 0 ? "−" : ""}${data.obstacles?.[Math.abs(letter) - 1]?.name ?? Math.abs(letter)}`;
  return `class ${word.map(name).join(" ")}`;
}

export class ChartView {
  /** @param {SVGSVGElement} svg */
  constructor(svg) {
    this.svg = svg;
    this.x = 0; this.y = 0; this.scale = 10;   // of the middle of the screen; pixels per metre
    this.world = make("g");
    this.screen = make("g");
    this.back = make("g");
    this.over = make("g");
    svg.append(this.back, this.world, this.screen, this.over);
    new ResizeObserver(() => { this.known = undefined; this.place(); }).observe(svg);
  }

  /** Asked once a change of the window: it makes the browser lay the page out. */
  get size() { return this.known ??= this.measure(); }

  /** @returns {[number, number]} */
  measure() { const box = this.svg.getBoundingClientRect(); return [box.width || 1, box.height || 1]; }

  /** @type {[number, number] | undefined} */
  known;

  /** The middle moves by so many metres: what is on the screen is only shifted, once a frame, until
   * `place` draws it again. @param {number} dx @param {number} dy */
  pan(dx, dy) {
    this.x += dx; this.y += dy;
    this.panned[0] -= dx * this.scale; this.panned[1] += dy * this.scale;
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      const shift = `translate(${this.panned[0]} ${this.panned[1]})`;
      this.screen.setAttribute("transform", shift);
      this.over.setAttribute("transform", shift);
      this.lay();
      this.furniture();
    });
  }

  asked = false;
  panned = [0, 0];

  lay() {
    const [w, h] = this.size;
    this.world.setAttribute("transform",
      `translate(${w / 2} ${h / 2}) scale(${this.scale} ${-this.scale}) translate(${-this.x} ${-this.y})`);
  }

  place() {
    this.panned = [0, 0];
    this.screen.removeAttribute("transform");
    this.over.removeAttribute("transform");
    this.lay();
    this.furniture();
    this.onplaced?.();
  }

  /** @type {(() => void) | undefined} */
  onplaced;

  /** @param {number} x @param {number} y @returns {[number, number]} */
  toScreen(x, y) {
    const [w, h] = this.size;
    return [w / 2 + (x - this.x) * this.scale, h / 2 - (y - this.y) * this.scale];
  }

  /** @param {{clientX: number, clientY: number}} event @returns {[number, number]} */
  toWorld(event) {
    const box = this.svg.getBoundingClientRect();
    return [this.x + (event.clientX - box.left - box.width / 2) / this.scale,
      this.y - (event.clientY - box.top - box.height / 2) / this.scale];
  }

  /** @param {number} factor @param {[number, number]} about */
  zoom(factor, about) {
    const scale = Math.min(Math.max(this.scale * factor, 1e-4), 1e6);
    const f = this.scale / scale;
    this.x = about[0] + (this.x - about[0]) * f;
    this.y = about[1] + (this.y - about[1]) * f;
    this.scale = scale;
    this.place();
  }

  /** Show everything. @param {any} data */
  fit(data) {
    const xs = [data.base[0]], ys = [data.base[1]];
    for (const g of data.goals ?? []) { const p = placeOf(g); xs.push(p[0]); ys.push(p[1]); }
    for (const o of data.obstacles ?? []) {
      const r = o.radius ?? 0;
      for (const [x, y] of o.center ? [o.center] : o.polygon) { xs.push(x - r, x + r); ys.push(y - r, y + r); }
    }
    if (Array.isArray(data.bounds)) for (const [x, y] of cornersOf(data.bounds)) { xs.push(x); ys.push(y); }
    const low = [Math.min(...xs), Math.min(...ys)], high = [Math.max(...xs), Math.max(...ys)];
    const [w, h] = this.size;
    const wide = Math.max(high[0] - low[0], 1e-6), tall = Math.max(high[1] - low[1], 1e-6);
    this.x = (low[0] + high[0]) / 2; this.y = (low[1] + high[1]) / 2;
    this.scale = xs.length < 2 ? 10 : Math.min(w / (1.2 * wide), h / (1.25 * tall));
    this.place();
  }

  /** Grid, numbers, scale bar. */
  furniture() {
    const [w, h] = this.size;
    const step = roundStep(80 / this.scale);
    const parts = [];
    const [left, bottom] = [this.x - w / 2 / this.scale, this.y - h / 2 / this.scale];
    const [right, top] = [this.x + w / 2 / this.scale, this.y + h / 2 / this.scale];
    let lines = "";
    for (let k = Math.ceil(left / step); k <= right / step; k++) {
      const [sx] = this.toScreen(k * step, 0);
      lines += `M${sx} 0V${h}`;
      parts.push(make("text", { x: sx + 3, y: h - 4, class: "label" }, String(+(k * step).toPrecision(8))));
    }
    for (let k = Math.ceil(bottom / step); k <= top / step; k++) {
      const [, sy] = this.toScreen(0, k * step);
      lines += `M0 ${sy}H${w}`;
      parts.push(make("text", { x: 3, y: sy - 3, class: "label" }, String(+(k * step).toPrecision(8))));
    }
    const bar = roundStep(60 / this.scale), size = bar * this.scale;
    parts.push(make("path", { d: `M${w - size - 16} 14v6h${size}v-6`, class: "scale" }),
      make("text", { x: w - size / 2 - 16, y: 14, class: "label", "text-anchor": "middle" }, `${bar} m`));
    if (this.heading !== undefined) {
      parts.push(make("g", { transform: `translate(${w - 30} 48) rotate(${-this.heading})` },
        make("path", { d: "M0 -14L6 4H-6Z", class: "base" })),
      make("text", { x: w - 34, y: 70, class: "label" }, "N"));
    }
    parts.push(make("path", { d: `M${w / 2 - 9} ${h / 2}h18M${w / 2} ${h / 2 - 9}v18`, class: "cross" }));
    this.back.replaceChildren(make("path", { d: lines, class: "grid" }), ...parts);
  }

  /** @type {number | undefined} */
  heading;
}
