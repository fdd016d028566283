"""Figure 7.2: four friction laws, force against velocity; the law alone, and as simulated cards feel it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from clothsim import friction
from clothsim._arrays import Floats
from clothsim.reproduce import cards, pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.friction_laws import COLOURS, LAWS, NAMES, TABLE_7_1, Coefficients

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "(a) Coulomb friction does not depend on velocity; (b) stiction holds a body at rest up to F_S ≥ F_C; (c) from F_S "
    "friction falls continuously to F_C as the velocity grows (Stribeck); (d) and rises again through viscosity"
)

COEFFICIENTS = TABLE_7_1["card"]
FASTEST = 2.0  # m/s
LEVEL = replace(cards.Cards(), slope=0.0)
COAST, WINDOW = 1.9, 0.05  # s: cards thrown at FASTEST coast this long; friction is taken over windows
SLOWEST = 0.1  # m/s at the end of a window: slower, the law is not straight in it
PULLS = (0.03, 0.06, 0.09, 0.12, 0.15, 0.18, 0.195, 0.21, 0.24, 0.27, 0.3)  # applied over normal force
PULLED = 0.04  # s
TITLES = {"C": "(a) Coulomb", "CS": "(b) + stiction", "CSS": "(c) + Stribeck", "CSSV": "(d) + viscous"}


@dataclass(frozen=True)
class Measured:
    """Forces over the normal force: by velocity and law, and by pull and law.

    Attributes
    ----------
    speed : (n,) float64
        Velocities at which the law alone is evaluated [m/s].
    alone : dict of (n,) float64
        Its force along the velocity's axis over the normal force.
    coasting : dict of (speed, force)
        Of the simulated cards that slow down, mean speeds over windows [m/s].
    held : dict of (len(PULLS),) float64
        Friction of the law alone on a body at rest.
    pulled : dict of (len(PULLS),) float64
        Of the simulated cards over their first `PULLED` seconds.
    """

    setup: cards.Cards
    speed: Floats
    alone: dict[str, Floats]
    coasting: dict[str, tuple[Floats, Floats]]
    held: dict[str, Floats]
    pulled: dict[str, Floats]
    expected: dict[str, Floats]


def keywords(coefficients: Coefficients, law: str, areal_density: float) -> dict[str, float]:
    """Coefficients of a law, as `clothsim.friction.force` takes them."""
    return {key: value for key, value in coefficients.friction(law, areal_density).items() if key != "law"}


def measure(effort: Effort) -> Measured:
    """Evaluate the laws, let cards coast, and pull at cards at rest."""
    setup = LEVEL
    if effort.quick:
        setup = replace(setup, cells=(3, 4), dt=4e-3)
    speed = np.linspace(-FASTEST, FASTEST, 1001)
    weight = setup.mass * setup.pressing
    area = setup.width * setup.length
    ramp = np.array(PULLS) * weight
    alone, held = {}, {}
    for law in LAWS:
        given = keywords(COEFFICIENTS, law, setup.areal_density)
        sliding = friction.force(NAMES[law], weight, speed[:, None], area=area, **given)
        alone[law] = -np.asarray(sliding)[:, 0] / weight
        resting = friction.force(NAMES[law], weight, np.zeros((len(ramp), 1)), ramp[:, None], area=area, **given)
        held[law] = -np.asarray(resting)[:, 0] / weight
    frames = round(COAST / WINDOW)
    with effort.bar(frames + len(PULLS), "figure 7.2", "frame") as bar:
        run = cards.run(setup, COEFFICIENTS, COAST, frames, start=FASTEST, tick=bar.update)
        slopes = [replace(setup, slope=pull) for pull in PULLS]
        runs = effort.each(lambda slope: cards.run(slope, COEFFICIENTS, PULLED, 1, tick=bar.update), slopes, bar)
    coasting = {}
    for law in LAWS:
        middle = 0.5 * (run.speed[law][1:] + run.speed[law][:-1])
        moving = run.speed[law][1:] > SLOWEST
        coasting[law] = middle[moving], (setup.friction(run.times, run.speed[law])[1] / weight)[moving]
    times = np.array([0.0, PULLED])
    pulled, expected = {}, {}
    for law in LAWS:
        over = [slope.mass * slope.pressing for slope in slopes]
        found = [slope.friction(r.times, r.speed[law])[1][0] for slope, r in zip(slopes, runs, strict=True)]
        exact = [slope.friction(times, slope.exact(COEFFICIENTS, law, times).speed)[1][0] for slope in slopes]
        pulled[law], expected[law] = np.array(found) / over, np.array(exact) / over
    return Measured(setup, speed, alone, coasting, held, pulled, expected)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The cards' column of Table 7.1, and what is chosen."""
    return {
        **COEFFICIENTS.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "F_v of the scene [N/m2 per m/s]": COEFFICIENTS.per_area(measured.setup.areal_density),
        "coasting": f"cards thrown at {FASTEST:g} m/s on a level plane, friction by speeds every {WINDOW:g} s",
        "pulled": f"cards at rest on a plane whose slope is the pull, mean friction over the first {PULLED:g} s",
        "chosen": "which coefficients: the thesis draws the laws without values",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """The laws over velocity; the coasting cards; friction at rest."""
    curve = [
        (law, float(v), float(f)) for law in LAWS for v, f in zip(measured.speed, measured.alone[law], strict=True)
    ]
    cards_ = [
        (law, float(v), float(f), float(_law(law, np.array(v))))
        for law in LAWS
        for v, f in zip(*measured.coasting[law], strict=True)
    ]
    rest = [
        (law, pull, float(a), float(b), float(c))
        for law in LAWS
        for pull, a, b, c in zip(PULLS, measured.held[law], measured.pulled[law], measured.expected[law], strict=True)
    ]
    over = "over the normal force"
    return {
        "": Table(("law", "velocity [m/s]", f"friction {over}"), curve),
        "cards": Table(("law", "velocity [m/s]", f"friction {over}", "by (7.7)"), cards_),
        "rest": Table(("law", f"pull {over}", "law alone", "card, mean", "its differential equation"), rest),
    }


def _law(law: str, speed: Floats) -> Floats:
    """(7.7) over the normal force, written out here."""
    return COEFFICIENTS.acceleration(law, np.abs(speed), LEVEL.pressing) / LEVEL.pressing


def here(measured: Measured) -> str:
    """What the curves go through, and how near the cards are to them."""
    words = []
    for law in LAWS:
        values = [float(np.interp(v, measured.speed, measured.alone[law])) for v in (0.4, FASTEST)]
        words.append(f"{law} holds {measured.held[law].max():.3f}, slides at {values[0]:.3f} and {values[1]:.3f}")
    return (
        f"over the normal force at rest, at v_S = 0.4 m/s and at {FASTEST:g} m/s: {'; '.join(words)}; simulated cards "
        f"are at most {100 * _worst(measured):.1f} % off"
    )


def _worst(measured: Measured) -> float:
    """Largest relative difference of a coasting card's friction from (7.7)."""
    return max(float(np.abs(force / _law(law, speed) - 1.0).max()) for law, (speed, force) in measured.coasting.items())


def checks(measured: Measured) -> Sequence[Check]:
    """(7.6) and (7.7) written out, against the law alone and the cards."""
    found = []
    sign = np.sign(measured.speed)
    moving = sign != 0.0
    for law in LAWS:
        exact = sign * _law(law, measured.speed)
        limit = COEFFICIENTS.static(law)
        off = float(np.abs(measured.alone[law] - exact)[moving].max())
        held = float(np.abs(measured.held[law] - np.minimum(PULLS, limit)).max())
        found += [
            Check(f"{law}: sliding friction, largest difference", off, 0.0, 1e-12, "(7.7)"),
            Check(f"{law}: friction at rest, largest difference", held, 0.0, 1e-12, "(7.6): −F_e up to F_S"),
            Check(f"{law}: a card at rest, friction over its first {1e3 * PULLED:g} ms, largest difference",
                  float(np.abs(measured.pulled[law] - measured.expected[law]).max()), 0.0, 0.02 * limit,
                  "differential equation of the card; 2 % of what holds it, ten time steps from rest"),
        ]  # fmt: skip
    # The mean speed stands for the speeds of a window: less than 1e-3 off where the law is least straight.
    what = "coasting cards against (7.7), largest relative difference"
    found.append(Check(what, _worst(measured), 0.0, 0.01, "(7.7)"))
    return found


def draw(measured: Measured) -> bytes:
    """Four panels of force against velocity, and friction at rest against the pull below them."""
    note = (
        "Lines: the laws alone. Dots: simulated cards, above while they coast from 2 m/s, below over the first "
        f"{1e3 * PULLED:g} ms under a pull. μ_c = 0.1, μ_s = 0.2, v_S = 0.4 m/s, δ_S = 0.2, F_v = 0.6/s times the mass."
    )
    figure = pictures.figure("Figure 7.2: four friction laws", (16.0, 8.6), note)
    axes = figure.subplots(2, len(LAWS), sharey="row")
    forward = measured.speed > 0.0
    backward = measured.speed < 0.0
    for column, law in enumerate(LAWS):
        above, below = axes[:, column]
        colour, limit = COLOURS[law], COEFFICIENTS.static(law)
        pictures.tidy(above, TITLES[law], "velocity [m/s]", "friction over normal force" if column == 0 else "")
        pictures.tidy(below, "", "pull over normal force", "friction over normal force" if column == 0 else "")
        above.axhline(0.0, color=pictures.FAINT, linewidth=0.9)
        for part in (forward, backward):
            above.plot(measured.speed[part], measured.alone[law][part], color=colour, linewidth=2.0)
        above.plot([0.0, 0.0], [-limit, limit], color=colour, linewidth=2.0)
        if limit > COEFFICIENTS.mu_c:
            above.plot([0.0, 0.0], [-limit, limit], "o", color=colour, markersize=6)
        speed, force = measured.coasting[law]
        pull = np.linspace(0.0, PULLS[-1], 400)
        below.plot(pull, np.minimum(pull, limit), color=colour, linewidth=2.0)
        below.axhline(COEFFICIENTS.mu_c, color=pictures.FAINT, linewidth=1.0, linestyle=(0, (4, 3)))
        dots = {"color": pictures.INK, "markerfacecolor": "white", "zorder": 5}
        below.plot(PULLS, measured.pulled[law], "o", markersize=4.5, **dots)
        above.plot(speed, force, "o", markersize=3.2, **dots)
        slides = np.array(PULLS) > limit
        below.plot(np.array(PULLS)[slides], measured.expected[law][slides], "x", color=colour, markersize=7, zorder=4)
        below.set_ylim(0.0, 0.24)
    pictures.caption(axes[0, 0], "dots: cards that coast", (0.03, 0.97))
    pictures.caption(axes[1, 0], "line: what holds a body at rest, (7.6)\ndots: cards; crosses: differential equation")
    return pictures.png(figure)
