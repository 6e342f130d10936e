"""Random scenes end, in one way or another that says what became of them; `benchmarks/fuzz.py` runs thousands."""

import pytest

from ngalpha_pin.report.stability.random_scenes import build, outcome, random_recipe, script, shrunk

SEEDS, STEPS, SECONDS = 50, 20, 0.4


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("block", range(5))
def test_random_scenes_have_no_raw_errors(block):
    n = SEEDS // 5
    found = [outcome(random_recipe(seed), STEPS, SECONDS) for seed in range(block * n, (block + 1) * n)]
    assert [o.said for o in found if o.verdict == "raw error"] == []
    assert all("no motion at q0 changes" in o.said for o in found if o.verdict == "refused")
    assert sum(o.verdict in ("well", "energy rises") for o in found) >= n // 2


def test_recipes_can_be_made_again_and_printed():
    first, second = random_recipe(7), random_recipe(7)
    assert first == second != random_recipe(8)
    names = {"__name__": "script"}
    exec(script(first).partition("run =")[0], names)
    assert names["recipe"] == first
    assert names["scene"].collision_model.ngeoms == build(first)[0].collision_model.ngeoms


def test_recipes_shrink_as_long_as_the_verdict_stays(monkeypatch):
    monkeypatch.setattr(
        "ngalpha_pin.report.stability.random_scenes.outcome",
        lambda recipe: outcome.__globals__["Outcome"](
            "bad" if recipe["bodies"][-1]["mass"] != 1.0 else "well", True, "", 0
        ),
    )
    recipe = next(r for r in map(random_recipe, range(100)) if len(r["bodies"]) > 3)
    small = shrunk(recipe, "bad")
    assert len(small["bodies"]) == 1
    assert len(small["walls"]) == 1
    assert small["loop"] is None
    assert small["bodies"][0]["mass"] != 1.0
    assert not any(small["bodies"][0]["v"])
