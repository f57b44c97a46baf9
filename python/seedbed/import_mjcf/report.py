"""What is wrong with a model, and what the conversion changes: collected, so that a person sees all of it at once."""

from __future__ import annotations

from dataclasses import dataclass, field


class MjcfError(Exception):
    """A model cannot be converted.

    Attributes:
        messages: What is wrong, each with the file, the element, and what was expected.
    """

    def __init__(self, messages: list[str]) -> None:
        super().__init__("\n".join(messages))
        self.messages = messages

    def __reduce__(self) -> tuple[type[MjcfError], tuple[list[str]]]:
        return MjcfError, (self.messages,)


@dataclass
class Report:
    """Errors and warnings about one file, in the order in which they were found."""

    file: str
    """Name of the file, without its folder."""
    errors: list[str] = field(default_factory=list)
    changes: dict[str, list[str]] = field(default_factory=dict)
    """What is changed or left out, each with all elements that it concerns."""

    def error(self, element: str, message: str) -> None:
        """Something that cannot be converted. Equal errors are reported once."""
        text = f"{self.file}: {element}: {message}"
        if text not in self.errors:
            self.errors.append(text)

    def warning(self, element: str, message: str) -> None:
        """Something that is changed or left out; elements with equal messages are listed in one line."""
        elements = self.changes.setdefault(message, [])
        if element not in elements:
            elements.append(element)

    @property
    def warnings(self) -> list[str]:
        """Warnings without the name of the file."""
        return [f"{', '.join(elements)}: {message}" for message, elements in self.changes.items()]

    def raise_errors(self) -> None:
        """Raise all errors.

        Raises:
            MjcfError: There are some.
        """
        if self.errors:
            raise MjcfError(self.errors)
