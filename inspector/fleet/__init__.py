"""Fleets of drives: their list, the ledger of finished ones, the engine for the rest, and table, page and catalogue."""
