"""Figures of a series: what each drop found, over its speed; specimens that failed are hollow."""

from typing import Any, BinaryIO

from matplotlib.figure import Figure

PANELS = (
    ("F_M", "Maximum force F_M (N)", 1.0),
    ("t_c", "Contact time t_c (ms)", 1e3),
    ("eps_exact", "Restitution ε", 1.0),
    ("E", "Elastic modulus E (GPa)", 1e-9),
)


def save_series(series: dict[str, Any], to: BinaryIO) -> None:
    """F_M, t_c, ε and E over v0, with standard uncertainties, as SVG; v0_fail with its interval as a band."""
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    for axes, (key, label, factor) in zip(figure.subplots(2, 2).flat, PANELS, strict=True):
        for failed in (False, True):
            points = [p for run in series["runs"] if bool(run["failed"]["value"]) is failed and (p := _point(run, key))]
            if points:
                v0, u_v0, y, u = zip(*points, strict=True)
                axes.errorbar(
                    v0, [value * factor for value in y], [each * factor for each in u], u_v0, fmt="o", color="0.15",
                    markerfacecolor="white" if failed else "0.15", markersize=6, elinewidth=0.9,
                    label="failed" if failed else "intact",
                )  # fmt: skip
        limit = series["v0_fail"]
        if limit is not None:
            axes.axvline(limit["value"], color="0.4", linestyle="--", linewidth=1)
            if limit["lo"] is not None and limit["hi"] is not None:
                axes.axvspan(limit["lo"], limit["hi"], color="0.9", zorder=0, label="v0_fail, 95 %")
        axes.set(xlabel="Impact speed v0 (m/s)", ylabel=label)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="0.92", linewidth=0.6)
    figure.axes[0].legend(frameon=False, fontsize="small")
    figure.savefig(to, format="svg")


def _point(run: dict[str, Any], key: str) -> tuple[float, float, float, float] | None:
    """v0, its u, the value and its u; None where one is unknown."""
    finding = run["fit"].get("E") if key == "E" else run[key]
    v0 = run["v0"]
    if finding is None or finding["value"] is None or v0["value"] is None:
        return None
    return v0["value"], v0["u"] or 0.0, finding["value"], finding.get("u_total", finding["u"]) or 0.0
