"""The REST resources: those of Table 1, the delivery application's two, and the descriptions."""
