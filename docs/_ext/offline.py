"""Packs the built pages into one file, which ``gapwalk docs`` opens.

python docs/_ext/offline.py PAGES ARCHIVE
"""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

LEFT_OUT = {".buildinfo", "objects.inv", "_sources", ".doctrees", "jupyter_execute"}
DATE = (1980, 1, 1, 0, 0, 0)  # the same pages make the same file


def pack(folder: Path, archive: Path) -> int:
    """Write the pages of a folder into an archive; return their number."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    files = [path for path in files if not LEFT_OUT & set(path.relative_to(folder).parts)]
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
        for path in files:
            info = zipfile.ZipInfo(path.relative_to(folder).as_posix(), DATE)
            info.compress_type = zipfile.ZIP_DEFLATED
            packed.writestr(info, path.read_bytes())
    return sum(path.suffix == ".html" for path in files)


if __name__ == "__main__":
    source, target = map(Path, sys.argv[1:3])
    count = pack(source, target)
    print(f"{count} pages in {target}, {target.stat().st_size / 1e6:.1f} MB: gapwalk docs opens them")
