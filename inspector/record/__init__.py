"""What a run leaves behind: a Rerun recording of every frame and stage, and the layout that shows it."""
