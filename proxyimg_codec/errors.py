"""The error hierarchy. Everything the package raises on purpose is a `PxiError`.

Each class has the exit code that the command-line tools end with.
"""


class PxiError(Exception):
    """Base of all errors: what is wrong, where, and what to do about it.

    Args:
        message: What is said to the user.
        rule: Id of the statement of the specification that is broken, such as ``"CON-7"``; empty
            if there is none.
    """

    exit_code = 1

    def __init__(self, message: str = "", *, rule: str = "") -> None:
        self.rule = rule
        super().__init__(message)


class UsageError(PxiError):
    """An argument, flag or combination of them makes no sense."""

    exit_code = 2


class InputError(PxiError):
    """A file cannot be read or written, or a picture or mask cannot be used."""

    exit_code = 3


class FormatError(PxiError):
    """A `.pxi` file breaks a rule of the format.

    Args:
        message: What is wrong.
        where: The chunk it happened in, such as ``"chunk TEXR"``; empty if not known.
        offset: Byte offset in the file, or None.
        rule: As in `PxiError`.
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
    """The file or request is legitimate, but this version or installation cannot do it."""

    exit_code = 5


class LimitError(PxiError):
    """The file or request exceeds a limit; `Limits` says which and how to raise it."""

    exit_code = 6
