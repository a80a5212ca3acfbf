"""Make the reduced models that are shipped from their meshes: ``PYTHONPATH=tools python -m finite_elements``."""

from pathlib import Path

from finite_elements.machines import MODELS
from finite_elements.reduction import write

FOLDER = Path(__file__).parents[2] / "src" / "thermocomp" / "virtual" / "reduced"


def main() -> None:
    """Make all files anew."""
    for name, make in MODELS.items():
        path = FOLDER / f"{name}.npz"
        write(make(), path)
        print(f"{path.name}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
