"""`python -m ngalpha_pin` is the command `ngalpha-pin`."""

import sys

from .cli import main

sys.exit(main())
