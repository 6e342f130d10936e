"""What the tests of left-out work share."""

import pytest


@pytest.fixture
def count(monkeypatch):
    """Counts the calls of a function from now on."""

    def counted(owner, name):
        calls, original = [], getattr(owner, name)

        def wrapper(*args, **kwargs):
            calls.append(name)
            return original(*args, **kwargs)

        monkeypatch.setattr(owner, name, wrapper)
        return calls

    return counted


# The audit accuses these runs, on energy, displacement or slip, while their tests call them right: open, see CHANGELOG.
ACCUSED = {
    "flexible/test_beam_contact.py::test_beam_slides_on_the_ground_and_stops",
    "flexible/test_beam_contact.py::test_rope_on_a_drum_slides_beyond_the_ratio_of_euler_and_eytelwein[0.9-False]",
    "flexible/test_beam_contact.py::test_rope_on_a_drum_slides_beyond_the_ratio_of_euler_and_eytelwein[1.15-True]",
    "integrators/test_restart.py::test_impact_excites_a_spring_that_the_steps_do_not_resolve[100000000.0-0.0]",
    "integrators/test_restart.py::test_impact_excites_a_spring_that_the_steps_do_not_resolve[1000000000.0-0.0]",
    "integrators/test_restart.py::test_impact_excites_a_spring_that_the_steps_do_not_resolve[1000000000000.0-0.0]",
    "integrators/test_restart.py::test_impact_excites_a_spring_that_the_steps_do_not_resolve[1000000000000.0-0.5]",
    "scene/test_model_checks.py::test_flat_mesh_is_a_thin_plate_that_comes_to_rest[box]",
    "stability/test_stability.py::test_quick_selection_passes[inertia 1e-09]",
    "stability/test_stability.py::test_quick_selection_passes[spring of 1e+12]",
    "step_equations/test_sparse.py::test_wall_of_nine_boxes_is_hit_by_a_ball",
}


def pytest_collection_modifyitems(items):
    """Mark the runs that the audit accuses; one that it no longer accuses has to leave the list."""
    for item in items:
        if item.nodeid.removeprefix("tests/") in ACCUSED:
            item.add_marker(pytest.mark.xfail(reason="the audit accuses this run", strict=True))
