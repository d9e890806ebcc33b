"""Where the files of the paper's contract are, in a checkout and in a wheel alike."""

from conformance.contract.locating import folder_of

CONTRACT_DIR = folder_of("table1")
