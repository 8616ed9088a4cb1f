"""The routes of the API, one concern a module; `described` has what they say alike."""
