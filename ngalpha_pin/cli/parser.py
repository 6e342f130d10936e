"""A parser of arguments that says what was meant; nothing but the standard library is imported before it is needed."""

from __future__ import annotations

import argparse
import re
from difflib import get_close_matches
from importlib import metadata
from typing import NoReturn


class Parser(argparse.ArgumentParser):
    """A parser that says what was meant, under the usage of its own command."""

    def error_of(self, unknown: list[str]) -> NoReturn:
        """Arguments that this command does not know."""
        options = [option for action in self._actions for option in action.option_strings]
        close = get_close_matches(unknown[0].partition("=")[0], options, n=1) if unknown[0].startswith("-") else []
        hint = f" (did you mean {close[0]}?)" if close else ""
        self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")

    def error(self, message: str) -> NoReturn:
        """End with the usage and a message, where a command is misspelt with the one that is meant."""
        wrong = re.match(r"argument COMMAND: invalid choice: '(.*?)'", message)
        if wrong is not None:
            commands = [name for action in self._actions for name in action.choices or ()]
            close = get_close_matches(wrong[1].lower(), commands, n=1)
            hint = f"did you mean {close[0]!r}? " if close else ""
            hint = "report --audit FILE audits a saved run; " if wrong[1] == "audit" else hint
            message = f"there is no command {wrong[1]!r}; {hint}commands: {', '.join(commands)}"
        super().error(message)


class Version(argparse.Action):
    """Say the version; where the package cannot be imported, that of what is installed."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Say it and end."""
        try:
            from ngalpha_pin import __version__ as version
        except ImportError:
            version = metadata.version("ngalpha-pin")
        print(f"{parser.prog} {version}")
        parser.exit()


def numbers(text: str) -> tuple[float, ...]:
    """Numbers with commas between them."""
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: numbers with commas between them are expected") from error
