"""`python -m ngalpha_pin` is the command `ngalpha-pin`."""

import sys

from ngalpha_pin.cli.main import main

sys.exit(main())
