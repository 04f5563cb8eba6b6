"""Animation of the maps of a page: one slider and one play button move all of them."""

from __future__ import annotations

import json
from collections.abc import Sequence

from netsp.view.pictures import style
from netsp.view.pictures.film import Film, steps_of
from netsp.view.pictures.moments import VISITED, Moment
from netsp.view.pictures.picture_layout import PageLayout
from netsp.view.report.chart import View

CONTROLS = (
    '<div class="noprint"><button id="play" type="button">▶ play</button>'
    '<input id="slider" type="range" min="0" value="0" aria-label="position along the tour">'
    '<p class="note">Move the slider: the thick line is the tether, pulled taut round the '
    "obstacles as it is when the robot is there.</p></div>"
)

STATE = '<p class="state note noprint"></p>'
"""Captions of the current moment, below each map."""

STYLE = f"""
.map {{ background: #fff; width: 100%; max-width: 900px }} .map text {{ font-size: 12px }}
.map .name {{ font-size: 11px; fill: #1b2631; paint-order: stroke; stroke: #fff;
  stroke-width: 3px }}
.map .visit {{ font-size: 10.5px }} .map .grid {{ stroke: #e8edf1; fill: none }}
.map .goal.visited {{ fill: {style.VISITED} }} .map .goal.visited + .visit {{ fill: #fff }}
#slider {{ width: 100%; max-width: 900px }}
.legend {{ list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: .2em 1.2em;
  font-size: 13px }} .legend svg {{ vertical-align: -3px }}
@media (max-width: 600px) {{
  .map text {{ font-size: 20px }} .map .visit {{ font-size: 14px }} .map .name {{ font-size: 18px }}
}}
@media print {{
  .noprint, .map .robot, .map .tether, .map .done {{ display: none }} .map {{ max-height: 130mm }}
  .map .goal.visited {{ fill: #fff }} .map .goal.visited + .visit {{ fill: #000 }}
}}
"""

SCRIPT = """
const films = JSON.parse(document.getElementById("frames").textContent);
const maps = document.querySelectorAll("svg.map");
const states = document.querySelectorAll("p.state");
const last = films[0].at.length - 1;
const slider = document.getElementById("slider");
function show(k) {
  films.forEach((film, n) => {
    const f = film.moments[film.at[k]];
    const one = (name) => maps[n].querySelector(name);
    one(".tether").setAttribute("points", f.t);
    one(".robot").setAttribute("cx", f.r[0]);
    one(".robot").setAttribute("cy", f.r[1]);
    one(".done").setAttribute("points", f.p);
    const visited = new Set(f.v);
    for (const goal of maps[n].querySelectorAll(".goal"))
      goal.classList.toggle("visited", visited.has(Number(goal.dataset.goal)));
    states[n].textContent = f.s;
  });
}
slider.max = last;
let fresh = true;
slider.addEventListener("input", () => { fresh = false; stop(); show(Number(slider.value)); });
slider.value = Math.floor(last / 3);
show(Number(slider.value));
const button = document.getElementById("play");
let timer = null;
function stop() {
  clearInterval(timer);
  timer = null;
  button.textContent = "▶ play";
}
button.addEventListener("click", () => {
  if (timer !== null) return stop();
  if (fresh || Number(slider.value) >= last) slider.value = 0;
  fresh = false;
  button.textContent = "❚❚ pause";
  timer = setInterval(() => {
    slider.value = Number(slider.value) + 1;
    show(Number(slider.value));
    if (Number(slider.value) >= last) stop();
  }, 60);
});
"""


def script(films: Sequence[Film], views: Sequence[View]) -> str:
    """Return the script that moves the maps of a page, in order."""
    steps = steps_of(films, PageLayout.plane_frames + 1)[1]
    shown = [
        {
            "moments": [_frame(moment, view) for moment in film.moments],
            "at": [step.moments[n] for step in steps],
        }
        for n, (film, view) in enumerate(zip(films, views, strict=True))
    ]
    data = json.dumps(shown, allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="frames">{data}</script><script>{SCRIPT}</script>'


def _frame(moment: Moment, view: View) -> dict[str, object]:
    return {
        "t": view.points(moment.nodes),
        "r": view.point(moment.nodes[-1]),
        "p": view.points(moment.path),
        "s": moment.text,
        "v": moment.fates.get(VISITED, ()),
    }
