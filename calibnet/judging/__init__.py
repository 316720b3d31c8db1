"""Judging what was found: predictors, causes, uncertainty, and from them a `calibnet.verdict.Verdict`."""
