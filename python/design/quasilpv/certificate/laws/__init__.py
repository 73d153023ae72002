"""One file per law kind: its document, what it claims, how it is frozen; `registry` lists them."""
