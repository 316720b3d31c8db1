"""Networks of other papers: RegNet, CalibNet, LCCNet and what is known of CalibFormer, trained and run here.

They are written from the papers. Each module says what its paper leaves open and how it is decided. None starts from
weights that were trained elsewhere, as their papers do from ImageNet: the package has none for them.
"""
