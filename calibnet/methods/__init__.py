"""Other methods than the cascade, behind the interface `calibnet.calibrator`: one module or package each.

`registry` knows them by name. The cascade, ours, is `calibnet.cascade`.
"""
