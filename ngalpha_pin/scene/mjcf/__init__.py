"""MJCF files, read by MuJoCo's own compiler: defaults, classes, units and frames are what MuJoCo takes them for."""
