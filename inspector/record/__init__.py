"""Records a run with Rerun: every frame and stage, and the layout that shows them."""
