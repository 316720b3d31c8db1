"""Networks of other papers, trained and run here: RegNet, CalibNet, LCCNet, and CalibFormer as far as it is public.

They are implemented from the papers; each module says what its paper leaves open and what we chose. Papers start from
ImageNet weights. These networks start from random weights, as the package has no others for them.
"""
