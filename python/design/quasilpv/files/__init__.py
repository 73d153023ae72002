"""Files: read whole, written whole; no input of a command is overwritten, and a folder has one run at a time."""

from quasilpv.files.command import claim_file, claim_folder, forget_input, one_command
from quasilpv.files.reading import MAX_FILE_BYTES, read_bytes, read_large
from quasilpv.files.writing import readable_json, write_atomically, write_readable_json, written_whole

__all__ = [
    "MAX_FILE_BYTES",
    "claim_file",
    "claim_folder",
    "forget_input",
    "one_command",
    "read_bytes",
    "read_large",
    "readable_json",
    "write_atomically",
    "write_readable_json",
    "written_whole",
]
