"""Section 4.3: the ten parameters of the extended model, fitted to the calibration's own boards."""

from __future__ import annotations

from fringeworks.calibrate.extended.fit import ExtendedFit
from fringeworks.calibrate.extended.words import UNITS, summarise_fit
from fringeworks.experiments.paper.chapter import Chapter, Grid, Row
from fringeworks.experiments.paper.lab import Lab
from fringeworks.model import Extended

PRINTED = {
    "C1": "0.048",
    "C2": "0.083",
    "C3": "0",
    "C4": "0",
    "Kfp": "0",
    "Kphi": "2.7",
    "Ku0": "17.9",
    "Kv0": "0",
    "Kfc": "-6.975",
    "Kz": "0.2",
}
"""The paper's; its K' is Kz in files."""


def fit_parameters(lab: Lab) -> Chapter:
    """Fitted values beside the paper's, and what the planes can tell of them."""
    fits = {mode: lab.fit("paper", mode) for mode in ("paper", "map")}
    degeneracy = fits["map"].degeneracy
    words = (
        "The paper's own values are no target: they belong to its rig and its calibration. Its "
        "K_phi of 2.7 rad is 13.75 px of the projector, mostly a phi_0 that was not calibrated; "
        "ours is calibrated, with the principal point. Four of its ten are zero, as a fit would "
        "never leave them: they were not free.\n\n"
        f"Of the ten {degeneracy.rank} are independent on these planes and {degeneracy.usable} of "
        "use. In paper mode the six are fitted without priors, to printed corners; by MAP all ten "
        "with priors, to every pixel of the boards. Only z is fitted; x and y come from the "
        "calibrated ray."
    )
    return Chapter(
        heading="The ten parameters: section 4.3",
        words=words,
        rows=(
            Row(
                "of the ten, independent", "", f"{degeneracy.rank}", f"of use: {degeneracy.usable}"
            ),
            *(
                Row(
                    f"depth rms on the planes, {mode}, mm",
                    "",
                    f"{fit.rms_mm:.3f}",
                    f"{fit.rms_before_mm:.3f} with all ten at zero",
                )
                for mode, fit in fits.items()
            ),
        ),
        grids=(
            Grid(
                "Parameters of the paper's rig",
                ("", "unit", "paper", "ours, six free", "ours, MAP", "sigma over prior"),
                [_row(name, fits["paper"], fits["map"]) for name in Extended.NAMES],
            ),
        ),
        numbers={mode: summarise_fit(fit) for mode, fit in fits.items()},
    )


def _row(name: str, six: ExtendedFit, ten: ExtendedFit) -> tuple[str, ...]:
    free = f"{getattr(six.extended, name):.4g}" if name in six.free else "-"
    ratio = ten.sigma[name] / ten.prior[name]
    return (
        name,
        UNITS[name],
        PRINTED[name],
        free,
        f"{getattr(ten.extended, name):.4g}",
        f"{ratio:.2g}",
    )
