"""Training: `build` opens the data and the network that the options name; `Trainer` is the training loop."""
