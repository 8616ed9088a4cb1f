"""NI's own tests of its client, run against the virtual rig (`make conformance`)."""
