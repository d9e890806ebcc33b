"""Where this pack's files are."""

from pathlib import Path

CONTRACT_DIR = Path(__file__).parent
