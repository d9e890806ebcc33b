"""Find the programs and packages that good devices are made of, and build programs in Go."""

import os
import shutil
import subprocess
import tempfile
import zlib
from importlib.util import find_spec
from pathlib import Path

# Go compiles its standard library once, on a slow machine in more than a minute.
_BUILD_S = 300.0


class NotInstalledError(Exception):
    """Raised when a program or package is not installed; the message says how to install it."""


def program(name: str, package: str) -> str:
    """Return the path of a program, from PATH or /usr/sbin (which Debian leaves out of a user's PATH).

    Raises:
        NotInstalledError: it is not installed.
    """
    found = shutil.which(name, path=os.pathsep.join([os.environ.get("PATH", os.defpath), "/usr/sbin", "/sbin"]))
    if found is None:
        raise NotInstalledError(f"not installed: apt install {package}")
    return found


def check_installed(*modules: str) -> None:
    """Check that Python packages are installed.

    Raises:
        NotInstalledError: one is not.
    """
    lacking = [name for name in modules if find_spec(name) is None]
    if lacking:
        raise NotInstalledError(f"not installed: pip install {' '.join(lacking)}")


def built(*sources: Path) -> Path:
    """Build a Go program from source files, unless it is newer than all of them, and return its path.

    Raises:
        NotInstalledError: Go is not installed, or the build fails.
    """
    go = program("go", "golang-go")
    checksum = zlib.crc32(b"".join(source.read_bytes() for source in sources))
    binary = Path(tempfile.gettempdir(), f"roaas-go-{os.getuid()}", f"{sources[0].stem}-{checksum:08x}")
    if binary.exists():
        return binary
    binary.parent.mkdir(mode=0o700, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=binary.parent) as folder:
        environment = {**os.environ, "GOFLAGS": "-mod=mod", "GOPROXY": "off"}
        command = [go, "build", "-o", f"{folder}/built", *map(str, sources)]
        done = subprocess.run(  # noqa: S603 - the program found above, on files of ours
            command, capture_output=True, check=False, env=environment, timeout=_BUILD_S
        )
        if done.returncode:
            raise NotInstalledError(f"go build fails: {done.stderr.decode(errors='replace')[-200:]}")
        # Another run may have been faster: either result will do.
        Path(folder, "built").replace(binary)
    return binary
