// @ts-check
/** A path drawn by hand: its points, stroke by stroke, and its figures beside the tour. */

import { placeOf, said } from "./map.js";

/** Pixels between two points of a stroke, and from the base at which a path ends there. */
const STEP = 8, NEAR = 14;

export class DrawnPath {
  /** @param {any} page @param {import("./link.js").Link} link */
  constructor(page, link) {
    this.page = page;
    this.link = link;
    /** @type {number[][]} */
    this.points = [];
    /** @type {number[]} How many points there were before each stroke. */
    this.strokes = [];
    /** @type {any} */
    this.figures = null;
    /** @type {any} Figures as they would be at the cursor. */
    this.ahead = null;
    /** @type {any} */
    this.worth = null;
    this.note = "";
    this.own = `${Math.random()}`;
  }

  /** Whether there is a path. */
  get any() { return this.points.length > 1; }

  /** A stroke begins, the first one at the base. @param {number[]} p */
  begin(p) {
    this.strokes.push(this.points.length);
    if (!this.points.length) this.points.push(this.page.data.base.slice(0, 2));
    this.add(p, true);
  }

  /** The path goes on to a place; near the base it ends there. @param {number[]} p @param {boolean} click */
  add(p, click = false) {
    const view = this.page.view, last = this.points[this.points.length - 1];
    const base = this.page.data.base;
    const far = (/** @type {number[]} */ a, /** @type {number[]} */ b) => Math.hypot(a[0] - b[0], a[1] - b[1]) * view.scale;
    // a click near the base or a goal means it
    const goals = (this.page.data.goals ?? []).map((g) => placeOf(g).slice(0, 2));
    const aims = this.points.length > 1 ? [base.slice(0, 2), ...goals] : goals;
    const end = (click && aims.find((q) => far(p, q) < NEAR)) || p;
    if (far(end, last) < (click ? 1 : STEP)) return;
    this.points.push(end);
    this.measure();
  }

  /** The stroke ends: what the pointer left near the base is brought there. */
  end() {
    const view = this.page.view, base = this.page.data.base, last = this.points[this.points.length - 1];
    const stroke = this.points.length - (this.strokes[this.strokes.length - 1] ?? 0);
    if (stroke > 2 && last && Math.hypot(last[0] - base[0], last[1] - base[1]) * view.scale < NEAR) this.points.push(base.slice(0, 2));
    this.measure();
  }

  /** Take the last stroke back; whether there was one. */
  undo() {
    const count = this.strokes.pop();
    if (count === undefined) { if (!this.points.length) return false; this.points = []; }
    else this.points = this.points.slice(0, count);
    this.measure();
    return true;
  }

  clear() {
    this.points = [];
    this.strokes = [];
    this.measure();
  }

  /** What a page has drawn. @param {number[][]} points @param {string | undefined} by */
  take(points, by) {
    if (by === this.own || JSON.stringify(points) === JSON.stringify(this.points)) return;
    this.points = points;
    this.strokes = points.length ? [0] : [];
    this.measure();
  }

  /** Ask for the figures. */
  measure() {
    this.ahead = null;
    const asked = [...this.points];
    this.link.latest("drawn", { drawn: asked, by: this.own }, (answer) => {
      this.figures = answer.drawn;
      this.note = "";
      this.changed();
      this.rank();
    }, (error) => { this.figures = null; this.note = error; this.changed(); });
    this.changed();
  }

  /** Ask for the figures with the cursor as the next point. @param {number[]} at
   * @param {(text: string) => void} tell */
  look(at, tell) {
    if (!this.points.length) return;
    this.link.latest("ahead", { drawn: this.points, cursor: at }, (answer) => {
      const f = this.ahead = answer.drawn;
      if (f?.end_tether != null) {
        const held = f.entangled.map((/** @type {number} */ k) => this.page.data.obstacles?.[k]?.name ?? `#${k}`).join(", ");
        tell(`tether ${f.end_tether.toFixed(2)} m, ${said(this.page.data, f.end_word)}; straight home it would be ${held ? `entangled: ${held}` : "free"}`);
      }
      this.page.drawTethers();
    });
  }

  /** Ask what the order is worth, if it is another one. */
  rank() {
    const order = this.figures?.order ?? [];
    const key = `${this.page.version}:${order.join()}`;
    if (!order.length) { this.worth = null; return; }
    if (this.worth?.key === key) return;
    this.worth = { key, length: null, note: "solving …" };
    this.link.latest("order", { order }, (answer) => {
      this.worth = { key, ...answer.worth };
      this.changed();
    }, (error) => { this.worth = { key, length: null, note: error }; this.changed(); });
  }

  changed() { this.page.refill(); this.page.redraw(); }

  /** How a length stands beside the tour's. @param {number} length */
  beside(length) {
    const tour = this.page.tour;
    if (!tour?.length || tour.version !== this.page.version || tour.stale) return "";
    if (this.figures?.missing.length) return "";  // other goals: nothing to compare yet
    const more = length - tour.length, percent = 100 * more / tour.length;
    return Math.abs(percent) < 0.005 ? " (as the tour)" : ` (${more < 0 ? "−" : "+"}${Math.abs(more).toFixed(2)} m, ${Math.abs(percent).toFixed(1)} %)`;
  }

  /** Names and values for the panel. @returns {[string, string, boolean?][]} */
  rows() {
    const f = this.figures, data = this.page.data;
    if (!f) return this.note ? [["path", this.note, true]] : [];
    const goal = (/** @type {number} */ k) => data.goals[k]?.name ?? `#${k}`;
    const obstacle = (/** @type {number} */ k) => data.obstacles?.[k]?.name ?? `#${k}`;
    /** @type {[string, string, boolean?][]} */
    const rows = [
      ["length", `${f.length.toFixed(2)} m${this.beside(f.length)}`],
      ["time", `${f.time_s.toFixed(0)} s at ${f.speed} m/s`],
      ["goals", `${f.order.length} of ${f.order.length + f.missing.length} within ${f.radius} m: ${f.order.map(goal).join(" → ")}`],
    ];
    if (f.revisits.length) rows.push(["again", f.revisits.map(goal).join(", ")]);
    rows.push(["longest tether", f.longest_tether === null ? "unknown: obstacles enclose a part of the path"
      : `${f.longest_tether.toFixed(2)} of ${data.tether_length} m`, !f.fits]);
    rows.push(["tether here", f.end_tether === null ? "unknown" : `${f.end_tether.toFixed(2)} m, ${said(data, f.end_word)}`]);
    const held = f.entangled.map(obstacle).join(", ");
    rows.push([f.comes_home ? "at home" : "straight home", held ? `entangled: ${held}` : "free", Boolean(held)]);
    if (f.through.length) rows.push(["runs through", f.through.map(obstacle).join(", "), true]);
    if (f.out_of_bounds) rows.push(["runs", "out of bounds", true]);
    if (this.worth) {
      rows.push(["this order", this.worth.length == null ? this.worth.note
        : `${this.worth.length.toFixed(2)} m at best${this.beside(this.worth.length)}`]);
    }
    return rows;
  }
}
