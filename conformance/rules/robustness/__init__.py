"""The class ``robustness``: no request makes an API crash, hang, slow down or reveal its insides."""
