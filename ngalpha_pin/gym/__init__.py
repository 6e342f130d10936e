"""Learning environments of gymnasium on scenes (extra `gym`): `SceneEnv` to subclass, and three that are registered.

`import ngalpha_pin.gym` registers "ngalpha_pin/Quadruped-v0", "ngalpha_pin/Gripper-v0" and "ngalpha_pin/BallInCup-v0";
`gymnasium.make("ngalpha_pin.gym:ngalpha_pin/Quadruped-v0")` imports it by itself, and `gymnasium.make_vec` of the same
makes a `SceneVectorEnv`, whose environments step on threads.
"""

from ngalpha_pin.common.optional import require

gymnasium = require("gymnasium", "ngalpha_pin.gym", "pip install 'ngalpha-pin[gym]'")

from .ball_in_cup import BallInCup  # noqa: E402  (they need gymnasium)
from .gripper import Gripper  # noqa: E402
from .quadruped import Quadruped  # noqa: E402
from .scene_env import SceneEnv  # noqa: E402
from .vector_env import SceneVectorEnv  # noqa: E402

__all__ = ["BallInCup", "Gripper", "Quadruped", "SceneEnv", "SceneVectorEnv"]

for kind, steps in ((Quadruped, 500), (Gripper, 200), (BallInCup, 400)):
    gymnasium.register(
        f"ngalpha_pin/{kind.__name__}-v0",
        entry_point=f"{kind.__module__}:{kind.__name__}",
        vector_entry_point=f"ngalpha_pin.gym.vector_env:{kind.__name__}Vector",
        max_episode_steps=steps,
    )
