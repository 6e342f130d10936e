"""The compiled engine, on the C++ libraries that come with the wheels of pin and coal."""

from .libraries import load

_engine = load()


def versions() -> dict[str, str]:
    """Versions of pinocchio, coal and eigen that the engine was built against, and the compiler that built it."""
    return _engine.versions()
