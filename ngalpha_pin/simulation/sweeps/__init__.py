"""Many runs: a function over a grid of parameters, on processes of this machine or on a cluster."""
