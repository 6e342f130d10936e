"""A module's tests are found by its name."""

import ast
from functools import cache
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parent
# what is tested from outside, and where: its functions are reached by no shorter way
ELSEWHERE = {
    "cli.options": "cli/test_main.py",
    "collision.exposed": "collision/test_pieces.py",
    "collision.flush": "collision/test_pieces.py",
    "collision.solid_pairs": "collision/test_pieces.py",
    "contact.table": "contact/test_point_rows.py",
    "event_driven.dense_step": "event_driven/test_gap_watch.py",
    "event_driven.event_log": "event_driven/test_run.py",
    "event_driven.ode_solver": "event_driven/test_run.py",
    "event_driven.percussions": "event_driven/test_run.py",
    "event_driven.phase_loop": "event_driven/test_run.py",
    "event_driven.soft_contacts": "contact/test_compliant.py",
    "event_driven.phase_start": "event_driven/test_run.py",
    "event_driven.settling": "event_driven/test_run.py",
    "event_driven.smooth_phase": "event_driven/test_run.py",
    "event_driven.step_doubling": "event_driven/test_run.py",
    "event_driven.transitions": "event_driven/test_slip.py",
    "event_driven.user_events": "event_driven/test_run.py",
    "flexible.beams": "flexible/test_beam_dynamics.py",
    "gym.ball_in_cup": "gym/test_scene_env.py",
    "gym.gripper": "gym/test_scene_env.py",
    "gym.quadruped": "gym/test_scene_env.py",
    "initialization.balance": "initialization/test_statics.py",
    "integrators.native_attempt": "integrators/test_plain_steps.py",
    "oracle.problem": "oracle/test_oracle_agreement.py",
    "oracle.run": "oracle/test_oracle_run.py",
    "references.paper": "references/test_closed_forms.py",
    "report.audit_figure": "report/test_report.py",
    "report.command": "report/test_report.py",
    "report.figures": "report/test_report.py",
    "results.archive": "common/test_files.py",
    "results.equations": "results/test_corruptions.py",
    "results.impact_audit": "results/test_audit.py",
    "results.joining": "simulation/test_record.py",
    "results.parts": "simulation/test_scene_changes.py",
    "results.records": "simulation/test_resume.py",
    "results.stacked_times": "results/test_replay.py",
    "results.summary": "viz/test_notebook.py",
    "results.trajectory_file": "simulation/test_resume.py",
    "scene.beam_parts": "flexible/test_beam_contact.py",
    "scene.compliance": "contact/test_compliant.py",
    "scene.constraints": "constraints/test_constraint_set.py",
    "scene.mjcf.contacts": "scene/mjcf/test_reader.py",
    "scene.mjcf.contents": "scene/mjcf/test_reader.py",
    "scene.mjcf.forces": "scene/mjcf/test_reader.py",
    "scene.mjcf.geometry": "scene/mjcf/test_against_mujoco.py",
    "scene.mjcf.tree": "scene/mjcf/test_against_mujoco.py",
    "scene.model_parts": "scene/test_scene_parts.py",
    "scene.own_constraints": "constraints/test_user_defined.py",
    "scene.extra_states": "system/test_extra_states.py",
    "scene.model_files": "scene/test_bad_input.py",
    "scene.unilateral": "constraints/test_unilateral.py",
    "scene.visuals": "scene/test_urdf.py",
    "scene.welds": "simulation/test_scene_changes.py",
    "scene.scene": "scene/test_bad_input.py",
    "sensitivities.averaging": "sensitivities/test_parameters_of_runs.py",
    "sensitivities.columns": "sensitivities/test_parameters_of_runs.py",
    "sensitivities.force_laws": "sensitivities/test_steps.py",
    "sensitivities.jumps": "sensitivities/test_steps.py",
    "sensitivities.row_arms": "sensitivities/test_configuration.py",
    "sensitivities.start": "sensitivities/test_differentiated.py",
    "sensitivities.step_derivatives": "sensitivities/test_steps.py",
    "sensitivities.step_maps": "simulation/test_rollout.py",
    "sensitivities.tangent": "sensitivities/test_steps.py",
    "sensitivities.tree": "sensitivities/test_configuration.py",
    "sensitivities.ways": "sensitivities/test_parameters_of_runs.py",
    "simulation.variants": "simulation/test_scene_changes.py",
    "report.stability.command": "report/stability/test_stability.py",
    "report.stability.contacts": "report/stability/test_stability.py",
    "report.stability.scales": "report/stability/test_stability.py",
    "step.evaluation": "step/test_newton_matrix.py",
    "simulation.sweeps.cells": "simulation/sweeps/test_sweep.py",
    "simulation.sweeps.dataset": "simulation/sweeps/test_sweep.py",
    "system.names": "simulation/test_scene_changes.py",
    "viz.beam_figure": "viz/test_beams.py",
    "viz.payload": "viz/test_viz.py",
}
SOURCES = {"ngalpha_pin": "ngalpha_pin", "ngalpha_pin.robots": "robots", "ngalpha_pin.viz": "viz"}


def modules():
    """Every module with code, as its dotted name and the test file that its name asks for."""
    for package, folder in SOURCES.items():
        for file in sorted((ROOT / folder).rglob("*.py")):
            inner = file.relative_to(ROOT / folder).with_suffix("")
            if file.name in ("__init__.py", "__main__.py") or not computes(file):
                continue
            folder_of_tests = Path(*package.split(".")[1:]) / inner.parent
            yield ".".join((package, *inner.parts)), folder_of_tests / f"test_{inner.name.lstrip('_')}.py"


@cache
def nodes_of(file):
    return tuple(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))


def computes(file):
    """A file has functions that do something: not protocols, constants or tuples with names alone."""
    functions = (n for n in nodes_of(file) if isinstance(n, ast.FunctionDef))
    return any(not all(isinstance(line, ast.Expr) for line in function.body) for function in functions)


def strings(file):
    """What a test names, such as a system of `robots`."""
    return {node.value for node in nodes_of(file) if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def imported(file):
    """Dotted names that a test file imports, names within modules included."""
    for node in nodes_of(file):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.skipif(not (ROOT / "pyproject.toml").is_file(), reason="the sources are not beside the tests")
def test_every_module_is_tested_by_name():
    names = {name for file in HERE.rglob("test_*.py") for name in imported(file)}
    named = {f"ngalpha_pin.robots.{name}" for file in HERE.rglob("*.py") for name in strings(file)}
    missing = [
        f"{module}: no tests/{file}, and no test imports it"
        for module, file in modules()
        if not (HERE / file).is_file()
        and module not in names | named
        # what systems share is tested by their motion
        and not module.startswith("ngalpha_pin.robots._")
    ]
    elsewhere = {f"ngalpha_pin.{module}" for module in ELSEWHERE}
    assert [line for line in missing if line.split(":")[0] not in elsewhere] == []
    # and the list has no more than it needs
    assert elsewhere <= {line.split(":")[0] for line in missing}
    assert [file for file in ELSEWHERE.values() if not (HERE / file).is_file()] == []


@pytest.mark.skipif(not (ROOT / "pyproject.toml").is_file(), reason="the sources are not beside the tests")
def test_test_files_stand_in_the_folder_of_what_they_test():
    packages = {Path(*module.split(".")[1:]).parent for module, _ in modules()} | {
        Path("robots"),
        Path("viz"),
        Path("fuzz"),
    }
    strays = [f for f in HERE.rglob("test_*.py") if f.parent != HERE and f.parent.relative_to(HERE) not in packages]
    assert strays == []
