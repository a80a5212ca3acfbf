"""A service that corrects a LinuxCNC at random, to be killed: its arguments are the socket and a seed."""

import asyncio
import random
import sys
from pathlib import Path

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ThermocompError
from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink


async def main() -> None:
    rng = random.Random(int(sys.argv[2]))
    sink = LinuxCncSink(path=Path(sys.argv[1]), axes={"x_um": "X", "z_um": "Z"})
    while True:
        try:
            await sink.connect(2.0)
            print("connected", flush=True)
            while True:
                await sink.apply(
                    {
                        "x_um": Correction(
                            rng.uniform(-60.0, 60.0), rng.uniform(-50.0, 50.0), rng.uniform(-99.0, 99.0)
                        ),
                        "z_um": Correction(rng.uniform(-60.0, 60.0)),
                    }
                )
                await asyncio.sleep(rng.uniform(0.0, 0.3))
        except ThermocompError:
            await asyncio.sleep(0.05)


if __name__ == "__main__":
    asyncio.run(main())
