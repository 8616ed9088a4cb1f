"""The routes of the API, one concern a module; `described` holds their common parts."""
