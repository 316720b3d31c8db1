"""What a run leaves behind: a Rerun recording of every frame and stage."""
