"""The files with checks, in the order in which they run."""

import check_touches  # noqa: F401
import check_exports  # noqa: F401
import check_imports  # noqa: F401
import check_qif_back  # noqa: F401
import check_contacts  # noqa: F401
import check_json  # noqa: F401
