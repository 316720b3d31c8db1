"""nuScenes by its published tables: one camera and the LiDAR of one scene."""
