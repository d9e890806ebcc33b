"""The robot as both interfaces see it: deliveries, goals, velocity, pose and plans. Nothing of REST or SOAP."""
