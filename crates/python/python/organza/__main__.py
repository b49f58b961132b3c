"""``python -m organza`` is the command ``organza``."""

import sys

from .command import main

sys.argv[0] = "organza"
sys.exit(main())
