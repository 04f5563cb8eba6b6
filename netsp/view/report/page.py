"""Self-contained page about a comparison of solvers: figures, tables, and all rows."""

from __future__ import annotations

import base64
import csv
import html
import io
from collections import Counter
from pathlib import Path
from typing import Any

from netsp.base.errors import InputError
from netsp.base.files import csv_cell as plain_cell
from netsp.base.files import write_text
from netsp.study.compare.rows import TrialRow, read_rows
from netsp.view.pictures import style
from netsp.view.report import figures
from netsp.view.report.html_document import STYLE
from netsp.view.report.stats import (
    Cell,
    best_lengths,
    bound_of,
    cells,
    failures,
    is_proven,
    methods,
    over_best,
    summary,
)

CAPTIONS = {
    "length": "Path length over the best known tour of the same problem (median, 95 % interval of "
    "the median), as in Fig. 5a–c of McCammon & Hollinger 2017.",
    "time": "Seconds for roadmap, legs and solver together (median, 95 % interval), as in Fig. "
    "5d–f.",
    "profile": "Share of the problems proven within a multiple of the fastest method's "
    "time (Dolan & Moré 2002); of which tours, the table of cells says.",
    "anytime": "How the best tour so far approaches the best known: median over all trials.",
    "entangled": "Obstacles that tours of blind baselines wrap around.",
}


def write_report(results: str | Path, output: str | Path, pictures: str | None = None) -> Path:
    """Write the page about a results file, and return its path.

    With `pictures` (svg, png or pdf), also write the figures as files beside it. Raises InputError
    if the results cannot be read or have no trial.
    """
    rows = read_rows(results)
    if not rows:
        raise InputError(f"{results}: holds no trial yet")
    by_method = methods(rows)
    by_cell, best = cells(by_method), best_lengths(rows)
    drawn = {
        "length": figures.lengths(by_cell, best),
        "time": figures.times(by_cell),
        "profile": figures.performance(by_method),
        "anytime": figures.anytime(by_method, best),
        "entangled": figures.entanglements(by_cell),
    }
    output = Path(output)
    parts = [_head(rows, str(results))]
    for name, figure in drawn.items():
        if figure is None:
            continue
        if pictures:
            style.save(figure, output.with_name(f"{output.stem}-{name}.{pictures}"))
        caption = html.escape(CAPTIONS[name])
        parts.append(f"<figure>{style.svg(figure)}<figcaption>{caption}</figcaption></figure>")
    parts += [
        _cells_table(by_cell, best),
        _proofs_table(by_cell),
        _failures_table(rows),
        _rows_link(rows, best),
    ]
    title = html.escape(rows[0]["study_name"])
    write_text(
        output,
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head><body>{''.join(parts)}</body></html>\n",
    )
    return output


def _head(rows: list[TrialRow], source: str) -> str:
    statuses = ", ".join(f"{n} {s}" for s, n in Counter(r["status"] for r in rows).most_common())
    redrawn = len({str(r["world"]) for r in rows if r.get("redrawn")})
    versions = {str(sorted(r.get("versions", {}).items())) for r in rows if r.get("versions")}
    shown: dict[str, str] = next((r["versions"] for r in rows if r.get("versions")), {})
    again = f", {redrawn} of them drawn again because a first draw did not fit" if redrawn else ""
    finished = " to ".join(sorted({pick(r["finished"] for r in rows) for pick in (min, max)}))
    return (
        f"<h1>{html.escape(rows[0]['study_name'])}</h1>"
        f"<p>{len(rows)} trials of {html.escape(source)} ({html.escape(statuses)}), "
        f"{len({r.get('problem_sha256') for r in rows})} problems{again}. Finished "
        f"{html.escape(finished)}.</p>"
        f'<p class="note">Study {html.escape(rows[0]["study"][:16])}; '
        f"{html.escape(', '.join(sorted({r['machine'] for r in rows})))}; "
        f"{html.escape(', '.join(f'{k} {v}' for k, v in shown.items()))}"
        f"{' (and other versions)' if len(versions) > 1 else ''}.</p>"
    )


def _table(head: list[str], body: list[list[Any]]) -> str:
    top = "".join(f"<th>{html.escape(h)}</th>" for h in head)
    lines = "".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in body)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{lines}</tbody></table>"


def _cells_table(by_cell: dict[Cell, list[TrialRow]], best: dict[str, float]) -> str:
    body = []
    for cell, rows in sorted(by_cell.items(), key=lambda c: (c[0].goals, c[0].tether)):
        over = summary([v for r in rows if (v := over_best(r, best)) is not None])
        seconds = summary([r["total_s"] for r in rows if r.get("length")])
        bounds = [(r["length"], b) for r in rows if r.get("length") and (b := bound_of(r))]
        gaps = summary([100.0 * b.gap(length) for length, b in bounds])
        scopes = ", ".join(dict.fromkeys(b.scope.tours for _, b in bounds))
        ids = " ".join(r["trial"] for r in rows)
        body.append(
            [
                html.escape(cell.method),
                cell.goals,
                f"{cell.tether:g}",
                len(rows),
                "" if over is None else f"{over.median:.2f} ({over.low:.2f} to {over.high:.2f})",
                "" if over is None else f"{over.mean:.2f}",
                ""
                if seconds is None
                else f"{seconds.median:.3g} ({seconds.low:.3g} to {seconds.high:.3g})",
                sum(is_proven(r) for r in rows),
                "" if gaps is None else f"{gaps.median:.3g}",
                scopes,
                f"<details><summary>rows</summary><code>{html.escape(ids)}</code></details>",
            ]
        )
    head = [
        "method",
        "goals",
        "tether",
        "trials",
        "% over best, median (95 %)",
        "mean",
        "seconds, median (95 %)",
        "proven",
        "gap %, median",
        "proofs and gaps: of",
        "rows",
    ]
    return "<h2>All cells</h2>" + _table(head, body)


def _proofs_table(by_cell: dict[Cell, list[TrialRow]]) -> str:
    """Return Table I: the mean time of proven trials, s, and their number of all trials."""
    out = []
    for method in dict.fromkeys(c.method for c in by_cell):
        rows_of_method = {
            (c.goals, c.tether): rows for c, rows in by_cell.items() if c.method == method
        }
        if not any(is_proven(r) for rows in rows_of_method.values() for r in rows):
            continue
        tethers = sorted({t for _, t in rows_of_method})
        body = []
        for goals in sorted({g for g, _ in rows_of_method}):
            line: list[Any] = [goals]
            for tether in tethers:
                rows = rows_of_method.get((goals, tether), [])
                proven = [r["total_s"] for r in rows if is_proven(r)]
                mean = f"{sum(proven) / len(proven):.3g} s " if proven else ""
                line.append(f"{mean}({len(proven)}/{len(rows)})" if rows else "")
            body.append(line)
        out.append(
            f"<h3>{html.escape(method)}</h3>"
            + _table(["goals", *map("{:g}".format, tethers)], body)
        )
    if not out:
        return ""
    note = (
        "Mean time of the trials proven, and how many were, as in Table I of the paper: their tour "
        "is the shortest of the tours named in the table of cells, which along a sampled roadmap "
        "are those of this roadmap."
    )
    return f'<h2>Proofs</h2><p class="note">{note}</p>' + "".join(out)


def _failures_table(rows: list[TrialRow]) -> str:
    failed = failures(rows)
    if not failed:
        return "<h2>Failures</h2><p>None.</p>"
    body = [
        [
            html.escape(r["solver"]["label"]),
            r["world"]["seed"],
            r["world"]["goals"],
            f"{r['world']['tether_length']:g}",
            html.escape(r["status"]),
            html.escape(r["message"][:200]),
            f"<code>{html.escape(r['trial'])}</code>",
        ]
        for r in failed
    ]
    head = ["solver", "world", "goals", "tether", "status", "message", "trial"]
    return f"<h2>Failures ({len(failed)})</h2>" + _table(head, body)


def _rows_link(rows: list[TrialRow], best: dict[str, float]) -> str:
    """Return a link to all rows as CSV, which the page contains."""
    out = io.StringIO()
    names = [
        "status",
        "length",
        "lower_bound",
        "lower_bound_of",
        "gap",
        "entangled",
        "roadmap_s",
        "matrix_s",
        "solve_s",
        "total_s",
        "problem_sha256",
        "message",
    ]
    writer = csv.writer(out)
    writer.writerow(
        [
            "trial",
            "family",
            "world",
            "goals",
            "tether",
            "roadmap",
            "solver",
            "seed",
            "over_best_percent",
            *names,
        ]
    )
    for r in rows:
        world, over = r["world"], over_best(r, best)
        writer.writerow(
            [
                plain_cell(r["trial"]),
                plain_cell(world["family"]),
                world["seed"],
                world["goals"],
                world["tether_length"],
                plain_cell(r["roadmap"]["label"]),
                plain_cell(r["solver"]["label"]),
                r["seed"],
                "" if over is None else f"{over:.6g}",
                *(plain_cell(v) if isinstance(v := r.get(name, ""), str) else v for name in names),
            ]
        )
    data = base64.b64encode(out.getvalue().encode()).decode()
    return (
        "<h2>Rows</h2><p>Every number above comes from these rows; a trial is found by its id. "
        f'<a download="rows.csv" href="data:text/csv;base64,{data}">rows.csv</a></p>'
    )
