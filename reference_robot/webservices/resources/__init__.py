"""One class per REST resource of Table 1, the delivery application's two, and the descriptions."""
