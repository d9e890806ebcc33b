"""What every page is made by: templates, and text that a robot controls made fit to be shown."""
