import numpy as np

def versions() -> dict[str, str]: ...

class ContactSolver:
    def __init__(self) -> None: ...
    def solve(
        self,
        sizes: np.ndarray,
        M: np.ndarray,
        kinds: np.ndarray,
        rows: np.ndarray,
        laws: np.ndarray,
        legs: np.ndarray,
        J: np.ndarray,
        bias: np.ndarray,
        guess: np.ndarray,
        tolerance: float,
        compliance: np.ndarray,
    ) -> tuple[np.ndarray, dict[str, float]]: ...
