"""``python -m quasilpv`` is the command ``design``."""

from quasilpv.cli import main

main()
