"""Judging what was found: witnesses, causes, uncertainty, and from them a `calibnet.verdict.Verdict`."""
