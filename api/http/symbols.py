"""The symbols of an answer for people: how each is written, what it is called and how it is defined."""

from dataclasses import dataclass

from markupsafe import Markup


@dataclass(frozen=True)
class Symbol:
    """`sign` as it is written, `name` in words, `definition` in a sentence."""

    sign: Markup
    name: str
    definition: str


def _s(sign: str, name: str, definition: str) -> Symbol:
    return Symbol(Markup(sign), name, definition)


GROUPS: dict[str, dict[str, Symbol]] = {
    "Impact": {
        "v0": _s("v<sub>0</sub>", "impact speed", "Speed of the dart at first contact: from the gate, the drop height, "
                 "the fall time, or as given; where two of them disagree a warning says so."),
        "F_M": _s("F<sub>M</sub>", "maximum force", "Greatest contact force: an estimate free of the bias that white "
                  "noise gives the largest sample. Ringing of the head is left in."),
        "t_M": _s("t<sub>M</sub>", "time of maximum force", "From first contact to the maximum force."),
        "alpha_M": _s("α<sub>M</sub>", "maximum displacement", "Greatest α(t) within the contact, "
                      "α = v0·t + ½·g·t² − (1/m)∬F dt²."),
        "t_c": _s("t<sub>c</sub>", "contact time", "From first contact until the force is back at zero. "
                  "Ringing goes on after it and does not count."),
        "J": _s("J", "impulse", "J = ∫F dt over the contact."),
        "E_M": _s("E<sub>M</sub>", "energy to maximum force", "E(t) = ∫F·v dt at the maximum force (ISO 6603-2)."),
        "l_M": _s("l<sub>M</sub>", "displacement at maximum force", "α at the maximum force (ISO 6603-2)."),
        "E_diss": _s("E<sub>diss</sub>", "dissipated energy", "E(t) = ∫F·v dt at the end of contact."),
        "alpha_r": _s("α<sub>r</sub>", "displacement left at the end of contact", "α(t_c). It still holds some bending "
                      "of a flexed plate, and is not the depth of the mark measured later."),
        "alpha_perm": _s("α<sub>perm</sub>", "permanent part of the displacement", "J/C of the series element."),
        "mark_diameter": _s("d<sub>mark</sub>", "diameter of the mark", "2√(2·r·α_perm), at the end of contact."),
    },
    "Restitution": {
        "eps_exact": _s("ε", "coefficient of restitution", "v1/v0 = J/(m·v0) − 1 − g·t_c/v0."),
        "eps_published": _s("ε<sub>pub</sub>", "as the papers write it", "J/(m·v0) − 1: leaves out the weight's "
                            "impulse and reads 0.01 to 0.04 high."),
        "eps_flight": _s("ε<sub>flight</sub>", "from the time of flight", "g·t_nc/(2·v0), t_nc from the end of contact "
                         "to the second contact."),
        "eps_gate": _s("ε<sub>gate</sub>", "from the gate", "Rebound speed at the gate, carried back to the height "
                       "of contact, over v0."),
        "v1": _s("v<sub>1</sub>", "rebound speed", "Speed at the end of contact, positive upwards."),
        "v1_gate": _s("v<sub>1,gate</sub>", "rebound speed from the gate", "Carried back to the height of contact."),
        "v1_flight": _s("v<sub>1,flight</sub>", "rebound speed from the time of flight", "g·t_nc/2."),
    },
    "Failure": {
        "failed": _s("failed", "specimen failed", "A sudden decrease of load, well before the energy is spent, "
                     "sharper than the ringing."),
        "failure_kind": _s("kind", "kind of failure", "What the record shows of the failure."),
        "failure_type": _s("type", "type of failure", "ISO 6603-2: yielding or splintering, and how."),
        "failure_type_operator": _s("type, seen", "type of failure as the operator saw it", "ISO 6603-2, from the test "
                                    "file; the record's proposal stands beside it."),
        "load_lost": _s("lost", "share of the stiffness that a crack took", "From then on, of what it was before."),
        "confidence": _s("confidence", "confidence in the verdict", "0 to 1: how clearly the record tells."),
        "t_failure": _s("t<sub>fail</sub>", "time of failure", "From first contact."),
        "F_failure": _s("F<sub>fail</sub>", "force at failure", "Contact force just before the load falls."),
        "alpha_failure": _s("α<sub>fail</sub>", "displacement at failure", "α at t_fail."),
        "E_failure": _s("E<sub>fail</sub>", "energy to failure", "∫F·v dt up to t_fail."),
        "F_D": _s("F<sub>D</sub>", "first damage force", "ISO 6603-2: force at the first damage."),
        "l_D": _s("l<sub>D</sub>", "displacement at first damage", "ISO 6603-2."),
        "E_D": _s("E<sub>D</sub>", "energy to first damage", "ISO 6603-2."),
        "F_P": _s("F<sub>P</sub>", "puncture force", "ISO 6603-2: half of F_M, after it."),
        "l_P": _s("l<sub>P</sub>", "puncture displacement", "ISO 6603-2: α where the force has fallen to half of F_M."),
        "E_P": _s("E<sub>P</sub>", "puncture energy", "ISO 6603-2: energy up to l_P."),
    },
    "Routes to the speed": {
        "v0_gate": _s("v<sub>0,gate</sub>", "speed from the gate",
                      "w/Δt + g·(t_contact − t_mid), less guide friction."),
        "v0_height": _s("v<sub>0,height</sub>", "speed from the drop height", "√(2·g·h), less guide friction."),
        "v0_fall": _s("v<sub>0,fall</sub>", "speed from the fall time", "Fall time × g, less guide friction."),
    },
    "Record": {
        "t_contact": _s("t<sub>contact</sub>", "first contact", "On the record's own axis: first sample = 0."),
        "bounces": _s("n<sub>b</sub>", "bounces", "Contacts after the first that the record holds."),
        "t_second": _s("t<sub>second</sub>", "second contact", "On the record's own axis: first sample = 0."),
        "t_nc": _s("t<sub>nc</sub>", "time of flight", "From the end of contact to the second contact."),
        "t_fall": _s("t<sub>fall</sub>", "fall time", "From release to first contact."),
        "F_M_raw": _s("F<sub>M,raw</sub>", "largest sample", "Largest corrected sample of the contact: noise makes "
                      "it read high."),
        "baseline": _s("F<sub>base</sub>", "baseline", "Level of the force before contact, taken off the record."),
        "noise": _s("s<sub>F</sub>", "noise", "Standard deviation of the force before contact."),
        "ringing_Hz": _s("f<sub>ring</sub>", "ringing", "Frequency of the ringing of head or plate."),
        "ringing_decay": _s("τ<sub>ring</sub>", "decay of the ringing", "Time in which it falls to 1/e."),
        "ringing_amplitude": _s("A<sub>ring</sub>", "amplitude of the ringing", "At first contact."),
    },
}  # fmt: skip
SYMBOLS = {name: symbol for group in GROUPS.values() for name, symbol in group.items()}
