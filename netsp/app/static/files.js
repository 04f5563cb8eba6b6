// @ts-check
/** Files: dropped or chosen, saved under a name, exported. */

/** Fields that answer what an import asks for. @type {Record<string, string[]>} */
const FIELDS_OF = { inspect: ["viewpoints", "standoff"] };

/** @type {Record<string, string>} */
const LABELS = {
  base: "Base: latitude, longitude (degrees)",
  tether: "Tether length (m)",
  radius: "Radius of obstacles that are points (m)",
  line_width: "Width of open lines that are obstacles (m)",
  crs: "Coordinate system (such as EPSG:32632, or local)",
  units: "Unit of lengths in the file (m, mm, cm, ft, in, …)",
  viewpoints: "Viewpoints around each obstacle",
  standoff: "Distance of viewpoints from the obstacle (m)",
};

/** @param {any} page @param {import("./link.js").Link} link @param {(text: string, bad?: boolean) => void} say */
export function files(page, link, say) {
  const token = encodeURIComponent(new URLSearchParams(location.search).get("token") ?? "");
  const input = /** @type {HTMLInputElement} */ (document.getElementById("file"));

  /** Asks for what a map lacks, and reads it again. @param {File} file @param {string[]} said @param {string[]} asks
   * @param {Record<string, string>} before */
  function ask(file, said, asks, before) {
    const dialog = document.createElement("dialog"), form = document.createElement("form");
    form.method = "dialog";
    const title = document.createElement("h2");
    title.append(`${file.name}: more is needed`);
    const list = document.createElement("ul");
    for (const text of said) {
      const item = document.createElement("li");
      item.append(text);
      list.append(item);
    }
    form.append(title, list);
    const tether = page.data?.tether_length;
    if (tether !== undefined) before = { tether: String(tether), ...before };
    for (const key of new Set([...Object.keys(before), ...asks.flatMap((one) => FIELDS_OF[one] ?? [one])])) {
      const label = document.createElement("label"), field = document.createElement("input");
      field.name = key;
      field.value = before[key] ?? "";
      label.append(LABELS[key] ?? key, field);
      form.append(label);
    }
    const go = document.createElement("button"), stop = document.createElement("button");
    go.append("Import");
    stop.append("Cancel");
    stop.type = "button";
    stop.addEventListener("click", () => dialog.close());
    form.append(go, " ", stop);
    form.addEventListener("submit", () => {
      const given = Object.fromEntries([...new FormData(form)].map(([key, value]) => [key, String(value)]));
      takeIn(file, given);
    });
    dialog.addEventListener("close", () => dialog.remove());
    dialog.append(form);
    document.body.append(dialog);
    dialog.showModal();
  }

  /** @param {File} file @param {Record<string, string>} given */
  async function takeIn(file, given = {}) {
    say(`reading ${file.name} …`);
    const query = new URLSearchParams({ ...given, name: file.name });
    const answer = await fetch(`/import?token=${token}&${query}`, { method: "POST", body: file }).catch(() => null);
    if (answer?.status === 422 && answer.headers.get("content-type")?.startsWith("application/json")) {
      const { said, asks } = await answer.json();
      say(`${file.name}: more is needed`, true);
      ask(file, said, asks, given);
      return;
    }
    const text = answer ? await answer.text() : "netsp: the server is gone";
    if (!answer?.ok) { say(text.replace(/^netsp: /, ""), true); return; }
    page.refit(Number(answer.headers.get("x-version")));
    say(text.trim() ? text.trim().split("\n").join("; ") : `${file.name} is on the map; Ctrl+Z takes it back`);
  }

  /** What netsp export would write; what is wrong is said here. @param {string} name */
  async function fetched(name) {
    const answer = await fetch(`/download/${name}?token=${token}`).catch(() => null);
    if (!answer?.ok) { say(((await answer?.text()) ?? "netsp: the server is gone").replace(/^netsp: /, ""), true); return; }
    const named = /filename="([^"]+)"/.exec(answer.headers.get("content-disposition") ?? "");
    const a = document.createElement("a");
    a.href = URL.createObjectURL(await answer.blob());
    a.download = named ? named[1] : name;
    a.click();
    setTimeout(() => URL.revokeObjectURL(a.href), 10000);
    const notes = decodeURIComponent(answer.headers.get("x-notes") ?? "").split("\n").filter(Boolean);
    say([`Downloaded ${a.download}`, ...notes].join("; "));
  }

  page.download = fetched;
  document.getElementById("open")?.addEventListener("click", () => input.click());
  input.addEventListener("change", () => { if (input.files?.[0]) takeIn(input.files[0]); input.value = ""; });
  const menu = /** @type {HTMLSelectElement} */ (document.getElementById("get"));
  menu.addEventListener("change", () => { const name = menu.value; menu.value = ""; if (name) fetched(name); });

  document.getElementById("save")?.addEventListener("click", async () => {
    const name = page.file === null ? window.prompt("Save the problem as", `${page.data.name ?? "new"}.json`) : true;
    if (name === null) return;
    const answer = await link.ask({ save: name });
    say(answer.error ?? `saved as ${page.file}`, Boolean(answer.error));
  });

  const stage = document.body;
  stage.addEventListener("dragover", (event) => { event.preventDefault(); stage.classList.add("dropping"); });
  stage.addEventListener("dragleave", (event) => { if (!event.relatedTarget) stage.classList.remove("dropping"); });
  stage.addEventListener("drop", (event) => {
    event.preventDefault();
    stage.classList.remove("dropping");
    const file = event.dataTransfer?.files[0];
    if (file && !page.shown) takeIn(file);
  });
}
