// @ts-check
/** Files: dropped or chosen, saved under a name, exported. */

/** @param {any} page @param {import("./link.js").Link} link @param {(text: string, bad?: boolean) => void} say */
export function files(page, link, say) {
  const token = encodeURIComponent(new URLSearchParams(location.search).get("token") ?? "");
  const input = /** @type {HTMLInputElement} */ (document.getElementById("file"));

  /** @param {File} file */
  async function takeIn(file) {
    say(`reading ${file.name} …`);
    const answer = await fetch(`/import?token=${token}&name=${encodeURIComponent(file.name)}`, { method: "POST", body: file })
      .catch(() => null);
    const text = answer ? await answer.text() : "netsp: the server is gone";
    if (!answer?.ok) { say(text.replace(/^netsp: /, ""), true); return; }
    page.refit();
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
    say(`${a.download} is downloaded`);
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
