"""Runs the command: ``python -m aso_ftc`` is ``aso-ftc``."""

import sys

from ._command import main

sys.exit(main())
