"""RoAAS's own domain over REST: what its messages look like, and how a robot is read and driven."""
