"""The lock that the operating system has for an open file."""

from __future__ import annotations

import errno
import os

_TAKEN = (errno.EAGAIN, errno.EACCES)
_UNKNOWN = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)
"""What a file system without locks answers."""


def lock_file(descriptor: int) -> bool | None:
    """Lock an open file; return False if another process holds it, None without such locks.

    Taken is what the system has: `flock`, which Linux also sends to the server of NFS 4, or on
    Windows the locking of a byte range.
    """
    try:
        import fcntl
    except ImportError:
        return _lock_on_windows(descriptor)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _UNKNOWN:
            return None
        if error.errno in _TAKEN:
            return False
        raise
    return True


def _lock_on_windows(descriptor: int) -> bool:  # pragma: no cover (Windows)
    import msvcrt

    # Far beyond the end of the file, so that nobody's reading is in the way.
    os.lseek(descriptor, 1 << 30, os.SEEK_SET)
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except OSError:
        return False
    return True
