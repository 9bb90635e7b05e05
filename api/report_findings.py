"""What the drops of a series say together, as blocks of its report."""

from typing import Any

from api.drop import Drop
from api.report_parts import Block, Cell, Heading, Table, Text, bare, ends, interval, sign_of, with_u

OF_FAILED = ("v0", "F_failure", "t_failure", "alpha_failure", "E_failure")
RUPTURE = {
    "v0_fail": "speed at which half of the specimens fail", "v0_survived_max": "fastest that survived",
    "v0_failed_min": "slowest that failed", "F_rupture": "load at failure, mean",
    "sigma_r": "stress at failure, natural logarithm", "sigma_r_as_published": "stress as P1 printed it, log₁₀",
    "E_a": "½·m·v0_fail²", "E_a_prime": "energy up to failure, mean",
}  # fmt: skip


def failure(drops: list[Drop], series: dict[str, Any]) -> list[Block]:
    """What failed, when and at what; nothing where none did."""
    failed = [d for d in drops if d.failed]
    if not failed:
        return _staircase(series)
    rows: list[list[Cell]] = []
    for d in failed:
        found = d.answer["findings"]
        proposed, seen = found["failure_type"]["value"] or "–", found["failure_type_operator"]["value"]
        kind = f"{proposed}, operator: {seen}" if seen else proposed
        rows.append([d.run.test.specimen.id or "", *(with_u(s, found[s]) for s in OF_FAILED), kind])
    told: list[list[Cell]] = []
    for key, words in RUPTURE.items():
        v = series[key]
        if v:
            around = ""
            if v.get("lo") is not None:
                around = f"95 %: {bare(key, v, 'lo')} to {bare(key, v, 'hi')}"
            elif "n" in v:
                around = f"n = {v['n']}"
            told.append([sign_of(key), with_u(key, {"u": None, **v}), around, words])
    out: list[Block] = [
        Heading("Failure"),
        Table(["Specimen", *(sign_of(s) for s in OF_FAILED), "Type"], rows, (0, 6)),
        Table([], told, (0, 3)),
    ]
    for row in series["plate_checks"]:
        text = f"{row['text']}: {row['value']:.2f}, limit {row['limit']:g}: {row['word']}"
        out.append(Text(text, "plate-theory" if row["word"] == "beyond" else None))
    change = series["transition"]
    if change is not None:
        out.append(Text(
            f"Without a look at which failed: between {change['v0_lo']['value']:.3g} and "
            f"{change['v0_hi']['value']:.3g} m/s the load begins to last {change['ratio']:.2f} of what it did."
        ))  # fmt: skip
    return out + _staircase(series)


def _staircase(series: dict[str, Any]) -> list[Block]:
    """The up-and-down method, where the heights are a ladder."""
    steps = series["staircase"]
    if steps is None:
        return []
    E, deviation = steps["E_50"], steps["deviation"]["value"]
    half = "not yet known" if E["value"] is None else f"{with_u('E_50', E)}"
    spread = "" if deviation is None else f", deviation {deviation:.2g} J between specimens"
    return [
        Text(
            f"Up and down over {steps['drops']} drops (Dixon and Mood): half fail at {half}{spread}; "
            f"next height {steps['next_height_mm']:g} mm."
        )
    ]


def by_groups(series: dict[str, Any]) -> list[Block]:
    """Groups, their ratios, what E depends on, thickness, stacks, ranking: as far as the series has them."""
    out: list[Block] = []
    if len(series["groups"]) > 1:
        wanted = [s for s in ("F_M", "eps_exact", "E", "E_failure") if any(s in g["means"] for g in series["groups"])]
        rows: list[list[Cell]] = [
            [
                g["name"], str(g["drops"]), str(g["failed"]),
                *(interval(s, g["means"].get(s)) for s in wanted), interval("v0_fail", g["v0_fail"]),
            ]
            for g in series["groups"]
        ]  # fmt: skip
        head: list[Cell] = ["Group", "Drops", "Failed", *(sign_of(s) for s in wanted), sign_of("v0_fail")]
        out += [Heading("Groups"), Table(head, rows, (0,)), Text("Means with their 95 % intervals.")]
        ratios: list[list[Cell]] = [
            [
                pair["group"], pair["against"], sign_of(s), f"{r['value']:.3f}", f"{r['lo']:.3f} to {r['hi']:.3f}",
                r["text"],
            ]
            for pair in series["comparisons"] for s, r in pair["ratios"].items()
        ]  # fmt: skip
        if ratios:
            out.append(Table(["Group", "Against", "", "Ratio", "95 %", ""], ratios, (0, 1, 5)))
    if series["dependence"]:
        rows = [
            [
                f"E over {name.replace('_', ' ')}",
                f"{e['exponent']:+.3f}",
                f"{e['lo']:+.3f} to {e['hi']:+.3f}",
                e["text"],
            ]
            for name, e in series["dependence"].items()
        ]
        out += [Heading("What E depends on", 3), Table(["", "Exponent", "95 %", ""], rows, (0, 3))]
    reached = series["thickness"]
    if reached is not None:
        rows = [
            [f"{1e3 * r['thickness']:g} mm", *(f"{i['lo']:.3f} to {i['hi']:.3f}" for i in r["ratios"].values()),
             "same" if r["same"] else "not the same"]
            for r in reached["rows"]
        ]  # fmt: skip
        said = "no thinner one" if reached["value"] is None else f"{1e3 * reached['value']:g} mm on"
        out += [
            Heading(f"The same F(t) as {1e3 * reached['against']:g} mm: {said}", 3),
            Table(["Thickness", *(sign_of(s) for s in reached["rows"][0]["ratios"]), ""], rows, (3,)),
            Text(f"{reached['test']}. Necessary for a half-space, not sufficient: E may still read high."),
        ]
    for s in series["stacks"]:
        told = ", ".join(f"{k} {r['lo']:.3f} to {r['hi']:.3f}" for k, r in s["ratios"].items())
        out.append(Text(f"{s['stack']} against {s['plate']}: {'the same' if s['same'] else 'not the same'} ({told})."))
    if series["ranking"] is not None:
        by = series["ranking"]["by"]
        rows = [
            [
                str(k), r["material"], str(r["drops"]),
                *(interval(s, r[s]) for s in ("E_a", "E_a_prime", "F_rupture", "returned")),
            ]
            for k, r in enumerate(series["ranking"]["rows"], 1)
        ]  # fmt: skip
        head = ["", "Material", "Drops", sign_of("E_a"), sign_of("E_a_prime"), sign_of("F_rupture"), "ε²"]
        out += [Heading(f"Ranking of the materials, by {by.replace('_', ' ')}", 3), Table(head, rows, (1,))]
    return out


def joint_fits(series: dict[str, Any]) -> list[Block]:
    """What was fitted to all intact drops together."""
    out: list[Block] = []
    for key, words in (("one_E", "one E"), ("E_over_v0", "E = E_ref·(v0/v_ref)^n")):
        joint = series["joint"][key]
        if joint is None:
            continue
        unlike = "" if joint["agree"] else f"; they disagree, intervals {joint['widened']:.1f} times as wide"
        rows: list[list[Cell]] = [
            [name, with_u(name, p), "95 %: " + ends(name, p), p["verdict"]] for name, p in joint["parameters"].items()
        ]
        title = f"All intact drops together: {words}, at {joint['v_ref']:.3g} m/s ({joint['drops']} drops{unlike})"
        out += [Heading(title, 3), Table([], rows, (0, 3))]
    return out
