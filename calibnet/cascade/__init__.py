"""The five-stage cascade (paper section 3.5) on one frame."""
