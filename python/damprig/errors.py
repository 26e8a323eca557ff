"""Exceptions of damprig. Their texts are those of the command: what is wrong, where, what is allowed, and the likely fix."""

__all__ = [
    "DamprigError",
    "FaultError",
    "InputError",
    "InternalError",
    "RigError",
    "RunFolderError",
    "RunFolderWarning",
    "UnusualValueWarning",
]


class DamprigError(Exception):
    """Any error of damprig."""


class InputError(DamprigError, ValueError):
    """A case, a campaign, settings or an argument is wrong. Nothing was simulated, nothing has moved."""


class RunFolderError(DamprigError):
    """A run folder cannot be read, or cannot be written."""


class RigError(DamprigError):
    """The rig refused a request, or failed."""


class FaultError(RigError):
    """An interlock, or the friction damper's spring, ended an experiment.

    Attributes
    ----------
    cause : str
        What happened, in words.
    value, limit : float
        The value that violated the limit, and the limit, in the SI unit of the cause.
    """

    def __init__(self, message: str, cause: str, value: float, limit: float) -> None:
        super().__init__(message, cause, value, limit)
        self.cause = cause
        self.value = value
        self.limit = limit

    def __str__(self) -> str:
        return self.args[0]


class InternalError(DamprigError):
    """A defect of damprig itself."""


class UnusualValueWarning(UserWarning):
    """A value is allowed but unusual; it was used as it is."""


class RunFolderWarning(UserWarning):
    """A run folder is damaged or incomplete; what can be read was read."""
