"""One stage's network: one module per box of the paper's figure."""
