"""The engine is loaded with the libraries that it was built against, and says what to do where it is not."""

import coal
import pinocchio as pin
import pytest

from ngalpha_pin import engine
from ngalpha_pin.engine import libraries


def test_built_against_what_is_loaded():
    built = engine.versions()
    assert built["pinocchio"].split(".")[:2] == pin.__version__.split(".")[:2]
    assert built["coal"].split(".")[:2] == coal.__version__.split(".")[:2]
    assert built["eigen"].startswith("3.4.")
    assert built["compiler"].split()[0] in ("g++", "clang")


@pytest.mark.parametrize(("version", "fits"), [("4.1.7", True), ("4.2.0", False), ("4.10.0", False), ("5.1.0", False)])
def test_last_part_of_a_version_may_differ(version, fits):
    built = {"pinocchio": "4.1.0", "coal": "3.0.3"}
    found = libraries.mismatch(built, {"pinocchio": version, "coal": "3.0.9"})
    assert (found == "") == fits


def test_another_library_ends_the_import_with_what_to_install(monkeypatch):
    monkeypatch.setattr(coal, "__version__", "3.9.0")
    with pytest.raises(
        ImportError, match=r"built against coal 3\.0\.\d, but 3\.9\.0 is loaded; pip install 'coal==3\.0"
    ):
        libraries.load()


def test_missing_module_ends_the_import_with_what_to_install(monkeypatch):
    def fails(name):
        raise ImportError("undefined symbol: _ZN4coal")

    monkeypatch.setattr(libraries, "import_module", fails)
    with pytest.raises(
        ImportError, match=r"cannot be loaded with pinocchio [\d.]+, coal [\d.]+: undefined symbol.*install"
    ):
        libraries.load()
