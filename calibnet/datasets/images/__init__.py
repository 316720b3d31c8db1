"""Camera images: reading them, developing raw ones to eight bits, and undoing a lens's distortion."""
