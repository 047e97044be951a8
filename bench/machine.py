"""What a benchmark ran on."""

import os
import platform
from pathlib import Path


def machine() -> dict[str, object]:
    """Processor, number of cores, thread settings and versions, for the JSON line of a benchmark."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")
    threads = {
        name: os.environ[name] for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS") if name in os.environ
    }
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "threads": threads or "library defaults",
        "python": platform.python_version(),
        "system": platform.platform(),
    }
