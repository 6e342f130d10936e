"""What the command line says of a word that it does not know."""

import pytest

from ngalpha_pin.cli.parser import Parser


def parser():
    found = Parser("tool")
    commands = found.add_subparsers(metavar="COMMAND", parser_class=Parser)
    for name in ("run", "replay", "sweep"):
        commands.add_parser(name)
    return found


@pytest.mark.parametrize(
    ("word", "said"),
    [("swep", "did you mean 'sweep'?"), ("RUN", "did you mean 'run'?"), ("x", ""), ("audit", "report --audit FILE")],
)
def test_a_command_that_is_none_is_answered_by_those_that_are(capsys, word, said):
    with pytest.raises(SystemExit) as ended:
        parser().parse_args([word])
    printed = capsys.readouterr().err
    assert ended.value.code == 2
    assert f"there is no command {word!r}" in printed and said in printed and "commands: run, replay, sweep" in printed
