"""Pictures for the tabs: overlays, maps, search windows, slices, activations, the cloud and legends."""
