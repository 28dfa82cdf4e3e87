"""What the script of a page reads."""

from __future__ import annotations

import base64
import gzip
import json
import re
from typing import Any

import numpy as np


def content(page: str | None) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Read what the script of a page reads: its data and its arrays."""
    assert page is not None
    (data,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', page, re.DOTALL)
    (packed,) = re.findall(r'<script id="arrays"[^>]*>(.*?)</script>', page, re.DOTALL)
    whole, known = gzip.decompress(base64.b64decode(packed)), json.loads(data)
    arrays = [
        np.frombuffer(whole, dtype=f"<{entry['type']}", count=entry["length"], offset=entry["start"])
        for entry in known["arrays"]
    ]
    columns = [entry["columns"] for entry in known["arrays"]]
    return known, [part.reshape(-1, count) for part, count in zip(arrays, columns, strict=True)]
