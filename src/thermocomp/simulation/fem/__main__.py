"""Make the reduced models that are shipped from their meshes: ``python -m thermocomp.simulation.fem``."""

from pathlib import Path

from thermocomp.simulation.fem.machines import MODELS
from thermocomp.simulation.fem.reduction import write

FOLDER = Path(__file__).parents[1] / "reduced"


def main() -> None:
    """Make all files anew."""
    for name, make in MODELS.items():
        path = FOLDER / f"{name}.npz"
        write(make(), path)
        print(f"{path.name}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
