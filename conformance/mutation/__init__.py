"""What a mutant is made of: messages on the wire, and one change between a client and a good device."""
