"""CPU time of processes that a script has started."""

import resource


def children() -> float:
    """CPU time (s), user and system, of all processes that were started here and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
