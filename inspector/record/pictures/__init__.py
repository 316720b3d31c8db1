"""The pictures that tabs show: overlays, maps, search windows, slices, activations, the cloud and legends."""
