"""Training: `build` opens data and network as the recipe says, `Trainer` is the loop."""
