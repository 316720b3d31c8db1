"""A run: options, initial extrinsics, the loop from frames to a recording, and the summary."""
