"""FMUs as files: described, compiled, zipped, checked and exported; foreign ones unpacked and looked at first."""
