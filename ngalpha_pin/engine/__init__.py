"""The compiled engine, on the C++ libraries that come with the wheels of pin and coal."""

from .libraries import load

_engine = load()
PlainSteps, Servos, Ties = _engine.PlainSteps, _engine.Servos, _engine.Ties
GapMotion, ForceLaws, Crowd = _engine.GapMotion, _engine.ForceLaws, _engine.Crowd
RodForces, CableForces = _engine.Rod, _engine.Cable
Beams, BeamTable, internal_forces = _engine.Beams, _engine.BeamTable, _engine.internal_forces
Exposed, CoalShape, Solid, ShapePair = _engine.Exposed, _engine.CoalShape, _engine.Solid, _engine.ShapePair
Bodies, NearPairs, Places = _engine.Bodies, _engine.NearPairs, _engine.Places
SLOTS, TOUCH_STEPS = _engine.SLOTS, _engine.TOUCH_STEPS
apart, gap_along_normal = _engine.apart, _engine.gap_along_normal
solve_level, held_forces = _engine.solve_level, _engine.held_forces


def library_path() -> str:
    """The file of the compiled module, which has the functions of the kernel as well."""
    return str(_engine.__file__)


def versions() -> dict[str, str]:
    """Versions of pinocchio, coal and eigen that the engine was built against, and the compiler that built it."""
    return _engine.versions()
