"""FMUs as files: described, compiled, zipped, checked and exported; foreign ones are inspected and unpacked."""
