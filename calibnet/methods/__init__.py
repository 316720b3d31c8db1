"""Methods to compare the cascade with, one module or package each, with the interface of `calibnet.calibrator`.

`registry` has them by name. The cascade itself is `calibnet.cascade`.
"""
