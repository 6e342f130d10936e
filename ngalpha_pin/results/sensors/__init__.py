"""What a sensor would have shown: forces on bodies and in joints, motion of frames, computed from the stored arrays."""
