"""``python -m composer`` is ``brightfield``."""

import sys

from composer.cli import main

sys.exit(main())
