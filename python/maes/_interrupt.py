"""Raises KeyboardInterrupt in threads in which a controller decides; called by the native part."""

import ctypes
from collections.abc import Iterable


def interrupt(threads: Iterable[int]) -> None:
    """Raise KeyboardInterrupt in each of these threads at its next bytecode."""
    for thread in threads:
        error = ctypes.py_object(KeyboardInterrupt)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), error)
