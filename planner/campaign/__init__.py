"""A campaign: what was decided and measured, as an append-only log and the fold over it."""
