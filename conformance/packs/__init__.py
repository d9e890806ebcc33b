"""The contract packs that come with the suite, one folder each."""
