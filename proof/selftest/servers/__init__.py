"""Web servers with default settings (nginx, HAProxy and others) that stand in front of a good robot in controls."""
