"""`droptower model`: the findings of a predicted drop, and its picture."""

from pathlib import Path
from typing import Annotated, Any

import typer

from api.commands.options import Json, Kind, checked_figure
from api.commands.show import print_answer, print_json, tell


def model(
    kind: Annotated[Kind, typer.Argument(help="Which elements: conservative, parallel, series or flexed.")],
    mass_kg: Annotated[float, typer.Option("--mass-kg", help="Falling mass.")],
    v0: Annotated[float, typer.Option("--v0", help="Speed at contact, m/s.")],
    tip_radius_mm: Annotated[float, typer.Option("--tip-radius-mm", help="Radius of the tip.")],
    nu: Annotated[float, typer.Option("--nu", help="Poisson's ratio of the specimen.")],
    E_GPa: Annotated[float, typer.Option("--E-GPa", help="Elastic modulus of the specimen.")],
    C: Annotated[float | None, typer.Option("--C", help="Dashpot of parallel and series, kg/s.")] = None,
    Ci: Annotated[float | None, typer.Option("--Ci", help="Dashpot in series, kg/s; none: infinite.")] = None,
    Cd: Annotated[float, typer.Option("--Cd", help="Dashpot of the plate, kg/s.")] = 0.0,
    thickness_mm: Annotated[float | None, typer.Option("--thickness-mm", help="Plate on a ring: thickness.")] = None,
    support_radius_mm: Annotated[
        float | None, typer.Option("--support-radius-mm", help="And radius of the ring.")
    ] = None,
    restitution: Annotated[
        float | None, typer.Option("--restitution", help="Parallel: a dashpot of Hunt and Crossley instead of C.")
    ] = None,
    tip_E_GPa: Annotated[float | None, typer.Option("--tip-E-GPa", help="Modulus of the tip; none: rigid.")] = None,
    tip_nu: Annotated[float, typer.Option("--tip-nu", help="Poisson's ratio of the tip.")] = 0.3,
    g: Annotated[float, typer.Option("--g", help="Acceleration of gravity, m/s².")] = 9.80665,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="FILE.png or FILE.svg to draw it in.", metavar="FILE")
    ] = None,
    as_json: Json = False,
) -> None:
    """Predict a drop by a lumped model: its findings, and with --plot its force, displacement and elements."""
    from analysis.contact_solver import NotSolved, solve
    from analysis.models import Model, hunt_crossley, plate_stiffness, tip_stiffness
    from analysis.predict import predict

    _fit(kind, C, Ci, Cd, thickness_mm, support_radius_mm)
    _beside(kind, C, restitution)
    if plot is not None:
        checked_figure(plot)
    limits = [("--tip-radius-mm", tip_radius_mm, 0, 1e4), ("--E-GPa", E_GPa, 0, 1e5)]
    limits += [] if tip_E_GPa is None else [("--tip-E-GPa", tip_E_GPa, 0, 1e5)]
    for name, value, low, high in limits:
        if not low < value < high:
            raise typer.BadParameter(f"has to be above {low} and below {high:g}, not {value:g}", param_hint=name)
    for name, ratio in (("--nu", nu), ("--tip-nu", tip_nu)):
        if not 0 <= ratio < 0.5:
            raise typer.BadParameter(f"has to be 0 or more and below 0.5, not {ratio:g}", param_hint=name)
    E, r = E_GPa * 1e9, tip_radius_mm * 1e-3
    tip_E = None if tip_E_GPa is None else tip_E_GPa * 1e9
    inf = float("inf")
    series = (C if kind is Kind.series else Ci) if kind is not Kind.parallel else None
    chi = 0.0 if restitution is None or not v0 > 0 else hunt_crossley(restitution, v0)
    try:
        K_d = inf
        if thickness_mm is not None and support_radius_mm is not None:
            K_d = plate_stiffness(thickness_mm * 1e-3, support_radius_mm * 1e-3, E, nu)
        constants = Model(
            kind.value, mass_kg, tip_stiffness(r, E, nu, tip_E, tip_nu)[0], K_d, inf if series is None else series, Cd,
            (C or 0.0) if kind is Kind.parallel else 0.0, chi, g,
        )  # fmt: skip
        solution = solve(constants, v0)
    except (ValueError, NotSolved) as e:
        tell(f"droptower: {e}")
        raise typer.Exit(1) from None
    settings = {"model": kind.value, "g": g, "K_i": constants.K_i, "K_d": None if K_d == inf else K_d}
    answer: dict[str, Any] = {**predict(solution, r).to_json(), "fit": None, "settings": settings}
    if as_json:
        print_json(answer)
    else:
        known = {symbol: finding for symbol, finding in answer["findings"].items() if finding["value"] is not None}
        print_answer({**answer, "run": f"{kind.value} model", "series": None, "findings": known})
    if plot is not None:
        from api.figures import save_model

        save_model(solution, plot)
        tell(f"drawn in {plot}")


def _beside(kind: Kind, C: float | None, restitution: float | None) -> None:
    """Refuse a second dashpot, and one that the model has no place for."""
    if restitution is None:
        return
    if kind is not Kind.parallel or C is not None:
        raise typer.BadParameter("it is a dashpot of the parallel model, in place of --C", param_hint="--restitution")
    if not 0 < restitution <= 1:
        raise typer.BadParameter(
            f"has to be above 0 and 1 at the most, not {restitution:g}", param_hint="--restitution"
        )


def _fit(
    kind: Kind, C: float | None, Ci: float | None, Cd: float, thickness: float | None, radius: float | None
) -> None:
    """Refuse options that the model has no place for, and ask for those that it needs."""
    if (thickness is None) != (radius is None):
        raise typer.BadParameter("--thickness-mm and --support-radius-mm belong together: both, or none")
    if kind is Kind.flexed and thickness is None:
        raise typer.BadParameter("a flexed plate needs --thickness-mm and --support-radius-mm")
    if kind is not Kind.flexed and (thickness is not None or Ci is not None or Cd):
        raise typer.BadParameter(f"{kind.value} has no plate: --Ci, --Cd, --thickness-mm belong to flexed")
    if C is not None and kind not in (Kind.parallel, Kind.series):
        raise typer.BadParameter(f"{kind.value} has no dashpot --C; it belongs to parallel and series")
