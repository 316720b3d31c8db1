"""Judging a result: predictors of an error, causes and covariance give a `calibnet.verdict.Verdict`."""
