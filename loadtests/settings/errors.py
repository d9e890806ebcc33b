"""Why settings do not make a run."""


class SettingsError(ValueError):
    """Settings that are impossible or not allowed; the message says what to change."""
