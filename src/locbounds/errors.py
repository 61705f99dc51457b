"""The errors users meet: each names the cause and the remedy."""


class LocboundsError(Exception):
    """Base of every error raised on purpose by locbounds.

    Parameters
    ----------
    cause
        What is wrong, with the offending value.
    remedy
        What to change.

    Examples
    --------
    >>> str(InputError("the step is -1 s", "Give a positive number of seconds"))
    'the step is -1 s. Give a positive number of seconds'
    """

    def __init__(self, cause: str, remedy: str = ""):
        self.cause = cause
        self.remedy = remedy
        super().__init__(f"{cause}. {remedy}" if remedy else cause)


class InputError(LocboundsError, ValueError):
    """A value, file or option that cannot be used as it is."""


class RefusedError(LocboundsError, ValueError):
    """A bound or a comparison that would be meaningless for this scenario."""


class PrecisionError(LocboundsError, RuntimeError):
    """A JAX transformation reached locbounds while JAX computes in single precision."""
