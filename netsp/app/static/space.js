// @ts-check
/** The same in space, by plotly's script, which is asked for only then. */

/** @type {Promise<any> | null} */
let loading = null;

function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "/plotly.js";
    script.onload = () => resolve(/** @type {any} */ (window).Plotly);
    script.onerror = () => { loading = null; reject(new Error("the view in space needs plotly: pip install 'netsp[online]'")); };
    document.head.append(script);
  });
  return loading;
}

export class Space {
  /** @param {HTMLElement} place @param {import("./link.js").Link} link @param {(text: string, bad?: boolean) => void} say */
  constructor(place, link, say) {
    this.place = place; this.link = link; this.say = say;
    this.drawn = false;
    this.share = 0;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.update(this.share));
  }

  get open() { return !this.place.hidden; }

  /** @param {boolean} on @param {() => number} share */
  async show(on, share) {
    this.place.hidden = !on;
    if (!on) return;
    if (!this.drawn) this.say("loading the view in space …");
    try {
      this.plotly = await plotly();
    } catch (error) {
      this.place.hidden = true;
      this.say(error instanceof Error ? error.message : String(error), true);
      return;
    }
    this.update(share());
  }

  /** Draw it again, with the tether where the slider is. @param {number} share */
  update(share) {
    this.share = share;
    if (!this.open || !this.plotly) return;
    this.link.latest("space", { space: share }, (answer) => {
      const dark = matchMedia("(prefers-color-scheme: dark)").matches;
      const colour = dark ? "#e6ebef" : "#1b2631";
      const axis = { color: colour, gridcolor: dark ? "#3a444d" : "#d5dbe1", backgroundcolor: "rgba(0,0,0,0)" };
      const layout = { ...answer.space.layout, uirevision: "kept", paper_bgcolor: "rgba(0,0,0,0)", font: { color: colour } };
      layout.scene = { ...layout.scene, uirevision: "kept" };
      for (const a of ["xaxis", "yaxis", "zaxis"]) layout.scene[a] = { ...layout.scene[a], ...axis };
      delete layout.template;
      for (const trace of answer.space.data) {
        if (trace.name === "base") trace.marker.color = colour;
        if (trace.name === "goals") { trace.mode = "markers+text"; trace.textposition = "top center"; trace.textfont = { color: colour, size: 11 }; }
      }
      layout.scene.camera = { eye: { x: 1.6, y: -1.6, z: 1.1 } };
      this.plotly.react(this.place, answer.space.data, layout, { responsive: true, displayModeBar: false });
      this.place.dataset.drawn = "yes";
      if (!this.drawn) this.say("");
      this.drawn = true;
    }, (error) => this.say(error, true));
  }
}
