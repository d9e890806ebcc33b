"""What judges every exchange of a run by the paper's contract, whichever check sent it: live, and by roaas judge."""
