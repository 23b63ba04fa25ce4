"""What the functions raise, and what they warn of."""

from __future__ import annotations


class TroddenError(Exception):
    """Something could not be done; `message` says what, `advice` what helps, if that is known."""

    def __init__(self, message: str, advice: str | None = None) -> None:
        super().__init__(message, advice)
        self.message = message
        self.advice = advice

    def __str__(self) -> str:
        return self.message if self.advice is None else f"{self.message} (help: {self.advice})"


class ArgumentError(TroddenError, ValueError):
    """An argument is out of its range, or does not fit the others."""


class TroddenWarning(UserWarning):
    """Something was done, but somebody should look whether it is what was meant."""
