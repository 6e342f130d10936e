"""A scene as arrays, and the state between steps; only here Pinocchio's dynamics are called."""
