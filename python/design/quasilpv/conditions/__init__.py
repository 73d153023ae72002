"""Published and own conditions, one file per theorem, each written once in the vocabulary of `quasilpv.lmi`."""
