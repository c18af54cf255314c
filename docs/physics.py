"""``python docs/physics.py`` writes docs/physics.md: the catalogue of physics as the package has it."""

from pathlib import Path

from flexdrive_gym.drive.effects import EFFECTS, Effect
from flexdrive_gym.files import write_atomically

PAGE = Path(__file__).with_name("physics.md")

HEAD = """# The catalogue of physics

Everything the drive can have besides its two masses. An effect whose *sizes* are at their null is exactly absent; its
*shapes* (in italics, with their default) then have no influence. `Drive({..., "stribeck.cart_1.extra":
0.05})`, `effects={"stribeck.cart_1.extra": 0.05}` of an environment and `drive.toml` take the same names:
`id.place.parameter`, or `id.parameter` where there is one place. δ = x1 − x2; s is the direction of sliding. Derivations,
worked checks and literature are in `flexdrive_gym/drive/effects/<id>.py`.

Two entries of a diagnosis are no effects: `handout_ratios` is a property of the parameters, `encoder_dropout` a fault of
the data.

"""
ORDER = """
The command goes through limit, dead zone, gain, drift of the gain and offset, then delay and lag; then through the play of
the motor. A reading goes through play, scale, eccentricity, delay and quantisation. A Coulomb level is, in this
order, d, its asymmetry, its change along the track, the Stribeck peak, the share of the load, and all of it scaled by the
drift; never below zero.

Written by `python docs/physics.py`.
"""


def _parameter(effect: Effect, i: int) -> str:
    q = effect.parameters[i]
    names = dict.fromkeys(effect.key(place, q.name).split(".")[-1] for place in effect.where)
    unit = "" if q.unit == "1" else f" [{q.unit}]"
    if q.role == "shape":
        return f"*{', '.join(names)}*{unit} = {q.null:g}"
    return f"{', '.join(names)}{unit}"


def page() -> str:
    """Return the page as Markdown."""
    rows = ["| id | where | equation | parameters | recognised by | looks like |", "|---|---|---|---|---|---|"]
    for effect in sorted(EFFECTS, key=lambda e: (not e.base, e.id)):
        cells = (
            f"`{effect.id}`" + (" (base)" if effect.base else ""),
            ", ".join(effect.where),
            effect.equation,
            "; ".join(_parameter(effect, i) for i in range(len(effect.parameters))),
            effect.tells_itself_by,
            ", ".join(effect.looks_like) or "–",
        )
        rows.append("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")
    return HEAD + "\n".join(rows) + "\n" + ORDER


if __name__ == "__main__":
    write_atomically(PAGE, page())
