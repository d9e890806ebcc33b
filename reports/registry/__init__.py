"""Write a static site from signed certificates: which robot passed which classes, which key signed that, and when."""
