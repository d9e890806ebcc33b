"""Clean devices with descriptions of their own, one on FastAPI and one on Express: nothing may be found on them."""
