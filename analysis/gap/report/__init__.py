"""The diagnosis on one page, for people."""
