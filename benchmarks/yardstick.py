"""Gather the results of several runs of ``roaas selftest`` into a yardstick, by which each kill has a probability.

python benchmarks/yardstick.py FILE out/one/selftest.json out/two/selftest.json out/three/selftest.json
roaas selftest --against FILE --results out/later/selftest.json
"""

import sys
from pathlib import Path

from proof.selftest.against import file_content, read

if __name__ == "__main__":
    target, *runs = map(Path, sys.argv[1:])
    tables = read(runs)
    target.write_bytes(file_content(tables))
    print(f"{target}: {', '.join(f'{len(table)} {name}' for name, table in tables.items())}")
