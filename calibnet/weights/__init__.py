"""Weights as safetensors, with the training record in the header. Nothing here unpickles."""

from calibnet.weights.files import load_network, read_record, save_network, weights_path

__all__ = ["load_network", "read_record", "save_network", "weights_path"]
