"""What is done with the paper's robot: scenarios, which record traces and judge nothing."""
