"""Error classes. Every error that the package raises on purpose is a `PxiError`.

Each class holds the exit code with which the command-line tools end.
"""


class PxiError(Exception):
    """Base class of all errors; messages say the problem, the place, and the remedy.

    Args:
        message: Text for the user.
        rule: Id of the rule of the specification that is broken, such as ``"CON-7"``; empty if
            there is none.
    """

    exit_code = 1

    def __init__(self, message: str = "", *, rule: str = "") -> None:
        self.rule = rule
        super().__init__(message)


class UsageError(PxiError):
    """An argument or flag is invalid, or several of them contradict each other."""

    exit_code = 2


class InputError(PxiError):
    """A file cannot be read or written, or a picture or mask cannot be used."""

    exit_code = 3


class FormatError(PxiError):
    """A `.pxi` file breaks a rule of the format.

    Args:
        message: Description of the problem.
        where: Name of the chunk, such as ``"chunk TEXR"``; empty if it is not known.
        offset: Byte offset in the file; None if it is not known.
        rule: Id of the broken rule, as for `PxiError`.
    """

    exit_code = 4

    def __init__(
        self, message: str, where: str = "", offset: int | None = None, *, rule: str = ""
    ) -> None:
        self.problem = message
        self.where = where
        self.offset = offset
        place = where if offset is None else f"{where or 'file'} at byte {offset}"
        super().__init__(f"{place}: {message}" if place else message, rule=rule)


class UnsupportedError(PxiError):
    """The file or request is valid, but this version or installation does not support it."""

    exit_code = 5


class LimitError(PxiError):
    """The file or request exceeds one of the `Limits`; the message says which, and the remedy."""

    exit_code = 6
