"""Certificates for tests."""

import subprocess
from pathlib import Path


def pair(folder: Path, name: str, *options: str) -> tuple[Path, Path]:
    """Make a certificate for loopback, which is its own authority, and its key."""
    certificate, key = folder / f"{name}.pem", folder / f"{name}-key.pem"
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-days", "2"]
    names = ["-subj", "/CN=robot", "-addext", "subjectAltName=IP:127.0.0.1"]
    files = ["-keyout", str(key), "-out", str(certificate)]
    subprocess.run([*command, *names, *files, *(options or ["-nodes"])], check=True, capture_output=True)
    return certificate, key
