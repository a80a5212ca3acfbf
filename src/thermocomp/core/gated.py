"""Whether the do-no-harm gate permits a model to run, and to run without some of its inputs."""

from abc import abstractmethod
from collections.abc import Collection, Mapping

from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.provenance import HonestError, accepted
from thermocomp.core.watch import Watch


class Gated:
    """A model with its error on unseen cycles."""

    target: str
    inputs: tuple[Input, ...]
    honest_error: HonestError | None
    watch: Watch | None

    @property
    @abstractmethod
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation: see `thermocomp.core.family.ModelFamily`."""

    @property
    def accepted(self) -> bool:
        """True if the do-no-harm gate accepted this model."""
        return self.honest_error is not None and accepted(self.honest_error.word)

    def may_lose(self, names: Collection[str]) -> bool:
        """Return whether the model without these inputs is better than no compensation: see `HonestError.may_lose`."""
        return self.honest_error is not None and self.honest_error.may_lose(self._named(names), self.most_lost(names))

    def most_lost(self, names: Collection[str]) -> int:
        """Return the number of inputs without which the error may be predicted: a quarter of the watched temperatures.

        A lost speed is not predicted together with other inputs, as it also changes the substitutes of temperatures.
        """
        speeds = any(i.quantity == "spindle_speed" for i in self.inputs if i.name in names)
        return 1 if speeds or self.watch is None else len(self.watch.names) // 4

    def wrong_speeds(self, failed: Mapping[str, str]) -> list[str]:
        """Return the speeds that the model needs and that were wrong before that was found: the states remember them.

        Parameters
        ----------
        failed : mapping of str to str
            Sensors that are not trusted, with the kind of fault.
        """
        speeds = [i.name for i in self.inputs if i.quantity == "spindle_speed" and i.name in self.sensors]
        return [name for name in speeds if failed.get(name) == "off"]

    def widening(self, names: Collection[str]) -> float:
        """Return the factor by which the error on unseen cycles increases without some of the inputs; at least 1."""
        return 1.0 if self.honest_error is None else self.honest_error.widening(self._named(names))

    def _named(self, names: Collection[str]) -> list[str]:
        """Return the names that are inputs, in the order of the inputs."""
        return [i.name for i in self.inputs if i.name in names]

    def check_may_run(self) -> None:
        """Reject a model that the do-no-harm gate did not accept, unless a person approved it as unproven.

        Raises
        ------
        InputError
            The model was never judged, was judged by other rules than the current ones, was refused, or is unproven and
            not approved.
        """
        found = self.honest_error
        if found is None:
            raise InputError(
                f"model of {self.target} was never judged on unseen cycles and will not run: 'thermocomp fit' judges "
                "the models that it fits; a model fitted in another way can be compared and assessed"
            )
        found.check_may_run(self.target)
