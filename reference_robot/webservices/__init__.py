"""The web services of the paper: ROS publishers and subscribers, REST resources and SOAP services; no simulation."""
