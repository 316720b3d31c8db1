"""One stage's network: the paper's figure from top to bottom, a module for each box.

    image [B, 3, H, W]    ─ features ┐
                                     ├ cost volumes ─ hourglass ─ displacement ─ pose [B, 4, 4]
    scan as [B, 2, H', W] ─ features ┘

    features.py      image and scan → [B, C, h, w] each, at every scale
    cost_volume.py   → volume [B, Dy, Dx, h, w, G + 2Cc] and its cosine [B, D, h, w], D displacements of each cell
    aggregation.py   → logits [B, D, h, w], at every scale
    displacement.py  → displacement and its expected error, [B, 2, h, w] each, at the finest scale
    pose.py          → correction [B, 4, 4] and information [B, 6, 6]

It departs from the figure in two places. The paper regresses the pose from the aggregated volume. Here the volume is
first read as a displacement field, a box of its own, and the pose is what explains the field (`GeometricHead`);
`RegressionHead` is the paper's. And the hourglass is a residual on the cosine of the features: every volume has its
cosine beside it, logits are the cosine plus what the hourglass adds, and the cosine is trained to match by itself.
"""
