"""Rules of the class states."""
