"""Make the reduced models that are shipped from their meshes: ``python -m thermocomp.simulation.fem``."""

import sys
from pathlib import Path

try:
    from thermocomp.simulation.fem.machines import MODELS
    from thermocomp.simulation.fem.reduction import write
except ModuleNotFoundError as error:
    sys.exit(
        f"{error.name} is missing; it takes pip install 'thermocomp[fem]' to make the virtual machine, not to run it"
    )

FOLDER = Path(__file__).parents[1] / "reduced"


def main() -> None:
    """Make all files anew."""
    for name, make in MODELS.items():
        path = FOLDER / f"{name}.npz"
        write(make(), path)
        print(f"{path.name}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
